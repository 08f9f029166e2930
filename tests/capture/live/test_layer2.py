"""Interfaces by libpcap, as elsewhere than on Linux; the kernel's ring, which sees the same, is the oracle."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from typing import Any

import pytest

from nvscope.capture.live.layer2 import Layer2, _refused, _words
from nvscope.capture.live.layer2_devices import devices
from nvscope.capture.live.live_source import LiveSource
from nvscope.capture.live.wait import Wait
from nvscope.errors import CaptureError, UsageError
from tests.capture.live.network import Host, cable, needs_namespaces, send
from tests.oracle.builders import telegram

_REPORTS = """
import json, sys
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.live.bpf import default_program
from nvscope.capture.live.device import device_of
from nvscope.capture.live.layer2 import Layer2
from nvscope.capture.live.live_source import Autostop, LiveSource
from nvscope.capture.live.ring import KernelRing
from nvscope.capture.live.wait import Wait
device, bpf, end = device_of(sys.argv[1]), sys.argv[2], Autostop(duration_ns=int(float(sys.argv[3]) * 1e9))
ring = KernelRing(device, default_program(device.link, [1202]))
libpcap = Layer2(device.name, None if bpf == "-" else bpf, [1202])
sources = [LiveSource(inlet, Wait(), end) for inlet in (ring, libpcap)]
print("open", file=sys.stderr, flush=True)
for source in sources:
    inquiry = Inquiry(source)
    print(json.dumps(inquiry.report(inquiry.analyze())))
print(libpcap.failure(), file=sys.stderr)
"""
"""Reports on what comes by an interface, by the ring and by libpcap."""


def _watching(host: Host, bpf: str, seconds: float) -> subprocess.Popen[str]:
    """Start both reports on a host; all is open when this returns."""
    watching = host.start(sys.executable, "-c", _REPORTS, host.device, bpf, str(seconds))
    assert watching.stderr is not None
    assert watching.stderr.readline() == "open\n"
    return watching


def _reports(done: subprocess.Popen[str], failure: str = "") -> list[Any]:
    out, said = done.communicate(timeout=30)
    assert (done.returncode, said.strip()) == (0, failure)
    return [json.loads(line) for line in out.splitlines()]


@needs_namespaces
def test_what_it_sees_is_what_the_ring_sees() -> None:
    with cable() as (press, engineer):
        watching = _watching(engineer, "-", 1.5)
        press.start(*send("10.77.0.255", 300, 3)).wait(20)
        # Addressed to the host, which looks for its partner (ARP) and rejects them (ICMP).
        press.start(*send(engineer.address, 150, 3)).wait(20)
        ring, libpcap = _reports(watching)
    for part in ("frames", "telegrams", "other_frames", "drops"):
        assert ring["capture"][part] == libpcap["capture"][part], part
    assert libpcap["capture"]["telegrams"] == 450
    assert libpcap["capture"]["other_frames"] > 0
    assert abs(int(ring["capture"]["start_ns"]) - int(libpcap["capture"]["start_ns"])) < 1_000_000
    assert len(ring["lists"]) == 3
    for one, other in zip(ring["lists"], libpcap["lists"], strict=True):
        assert one["counters"] == other["counters"]
        # Times are those of the same moment, taken twice.
        assert _counts(one["diag"]) == _counts(other["diag"])
        assert one["streams"][0]["interval_ns"]["count"] == other["streams"][0]["interval_ns"]["count"]


def _counts(diag: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in diag.items() if not name.startswith("t")}


@needs_namespaces
def test_only_what_the_filter_lets_in_is_there() -> None:
    with cable() as (press, engineer):
        watching = _watching(engineer, "udp port 9", 0.8)
        press.start(*send("10.77.0.255", 50)).wait(10)
        ring, libpcap = _reports(watching)
    assert (ring["capture"]["frames"], libpcap["capture"]["frames"]) == (50, 0)


@needs_namespaces
def test_an_interface_that_is_deleted_ends_it_with_what_came() -> None:
    with cable() as (press, engineer):
        watching = _watching(engineer, "-", 15)
        press.start(*send("10.77.0.255", 30)).wait(10)
        time.sleep(0.4)
        engineer.ip("link", "del", engineer.device)
        reports = _reports(watching, "the interface is gone")
    assert [one["capture"]["telegrams"] for one in reports] == [30, 30]


def _opened(name: str = "lo", bpf: str | None = None, **more: Any) -> Layer2:
    try:
        return Layer2(name, bpf, [1202], **more)
    except CaptureError as error:
        if "permission" in error.what or "libpcap" in error.what:
            pytest.skip(error.what)
        raise


def test_what_came_before_it_was_stopped_is_there() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out,
    ):
        own.bind(("127.0.0.1", 0))
        port = own.getsockname()[1]
        source = LiveSource(_opened(bpf=f"udp port {port}"), Wait())
        for _ in range(40):
            out.sendto(telegram(), ("127.0.0.1", port))
        source.stop()
        found = [batch for batch in source if len(batch)]
    assert sum(map(len, found)) == 40
    assert {int(one) for batch in found for one in batch.original} == {14 + 20 + 8 + len(telegram())}
    (info,) = source.infos
    assert (info.frames, info.drops, info.format, info.failure) == (40, 0, "interface", "")


def test_names_and_filters_that_are_none() -> None:
    _opened().close()
    with pytest.raises(CaptureError, match="no interface has this name"):
        _opened("nosuch0")
    with pytest.raises(UsageError, match="-f udp prot 1"):
        _opened(bpf="udp prot 1")


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("en0: You don't have permission to capture on that device\n((cannot open BPF device) /dev/bpf0: "
         "Permission denied)", "no permission to capture"),
        ("eth9: No such device exists\n(SIOCGIFHWADDR: No such device)", "no interface has this name"),
        ("en0: That device is not up", "the interface is down"),
    ],
)  # fmt: skip
def test_what_libpcap_says_in_words(told: str, said: str) -> None:
    error = _refused("en0", told)
    assert error.what == said
    assert error.next_step
    assert _words("The interface disappeared") == "the interface is gone"


def test_interfaces_have_the_addresses_that_they_have() -> None:
    loopback = next(one for one in devices() if one.kind == "loopback")
    assert loopback.is_up
    assert "127.0.0.1/8" in map(str, loopback.addresses)
