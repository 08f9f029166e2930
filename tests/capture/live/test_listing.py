"""What can be captured on: ``ip`` is the oracle for interfaces, on a host of our own."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

import can
import pytest
from can.interfaces import BACKENDS

from nvscope.capture.live.addresses import addresses_of
from nvscope.capture.live.can import library
from nvscope.capture.live.device import device_of, names, state_of
from nvscope.capture.live.listing import can_channels, word_of
from nvscope.errors import CaptureError
from tests.capture.live.buses import forever
from tests.capture.live.network import cable, needs_namespaces

_LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux")


def _told_by_ip(*namespace: str) -> list[tuple[str, list[str]]]:
    done = subprocess.run(["ip", *namespace, "-j", "addr"], capture_output=True, text=True, check=True)
    return [
        (one["ifname"], [f"{address['local']}/{address['prefixlen']}" for address in one["addr_info"]])
        for one in json.loads(done.stdout)
    ]


@needs_namespaces
def test_interfaces_are_listed_with_their_addresses_and_meant_by_their_numbers() -> None:
    with cable() as (_, engineer):
        engineer.ip("addr", "add", "192.168.7.9/25", "brd", "+", "dev", engineer.device)
        engineer.ip("addr", "add", "10.9.0.1", "peer", "10.9.0.2/32", "dev", engineer.device)
        listing = engineer.nvscope("-D")
        out, said = listing.communicate(timeout=20)
        expected = _told_by_ip("-n", engineer.namespace)
        number = [name for name, _ in expected].index(engineer.device) + 1
        watching = engineer.nvscope("report", "--json", "-i", str(number), "--for", "300ms")
        report = json.loads(watching.communicate(timeout=20)[0])
    rows = [re.split(r"  +", line) for line in out.splitlines()]
    assert [row[0] for row in rows] == [f"{place}." for place in range(1, len(rows) + 1)], said
    assert [(row[1], row[4].split(", ")) for row in rows[: len(expected)] if len(row) > 4] == [
        (name, addresses) for name, addresses in expected if addresses
    ]
    assert rows[number - 1][1:4] == [engineer.device, "up", "Ethernet"]
    assert all(row[1].startswith("can:") for row in rows[len(expected) :])
    assert [one["path"] for one in report["capture"]["sources"]] == [engineer.device]


@_LINUX
def test_addresses_are_those_of_this_machine() -> None:
    assert "127.0.0.1/8" in map(str, addresses_of("lo"))
    assert addresses_of("no such one") == []
    assert word_of(1) == names()[0]
    with pytest.raises(CaptureError, match="no interface has the number 70000"):
        word_of(70_000)


@_LINUX
def test_a_loopback_is_known_for_one() -> None:
    device, state = device_of("lo"), state_of("lo")
    assert device is not None
    assert state is not None
    assert (device.kind_name, state.is_up) == ("loopback", True)


class _Finding(can.BusABC):
    """A driver that finds something; subclasses that never come back, or fail."""

    found: Callable[[], Sequence[Any]] = staticmethod(
        lambda: [
            {"interface": "finding", "channel": 3, "serial": "a7", "fd": False, "handle": object()},
            {"interface": "finding", "channel": "b,c=d"},  # what no word can say
            {"interface": "finding"},
        ]
    )

    @classmethod
    def _detect_available_configs(cls) -> Sequence[Any]:  # type: ignore[override]
        return cls.found()


class _Hanging(_Finding):
    found = staticmethod(forever)  # type: ignore[assignment]


class _Failing(_Finding):
    found = staticmethod(sys.exit)


def test_channels_that_drivers_find_are_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "DETECT_S", 0.3)
    for name in list(BACKENDS):
        monkeypatch.delitem(BACKENDS, name)
    for kind in (_Finding, _Hanging, _Failing):
        monkeypatch.setitem(BACKENDS, kind.__name__[1:].lower(), (__name__, kind.__name__))
    monkeypatch.setitem(BACKENDS, "absent", ("no.such.module", "Bus"))
    assert [one.word for one in can_channels()] == ["can:finding:3,serial=a7"]
