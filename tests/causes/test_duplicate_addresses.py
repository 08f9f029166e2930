"""Two devices with one IP address, and what looks like it: two senders, routers, mirrors, bonds, and a new device."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.causes.cause import Cause
from nvscope.findings.kind import Severity
from tests.causes.plants import causes_in, frames_of, from_hardware, readdressed
from tests.oracle.frame import Frame

PRESS, TWIN, HMI = "10.0.0.1", "10.0.0.9", "10.0.0.50"
PLANT = """
title = "a controller, and another one"
duration = "30s"

[[node]]
name = "press"
address = "10.0.0.1"
mac = "02:00:00:00:00:aa"
[[node]]
name = "twin"
address = "10.0.0.9"
mac = "02:00:00:00:00:bb"
[[node]]
name = "saw"
address = "10.0.0.2"

[[list]]
name = "axis"
index = 1
sender = "press"
bytes = [88]
interval = "100ms"
[[list]]
name = "blade"
index = 3
sender = "saw"
bytes = [40]
interval = "100ms"
"""
SENDS_TOO = '[[second_sender]]\nlist = "axis"\nnode = "twin"\nfrom = "10s"\n'
HAS_ARP = "".join(
    f'[[traffic]]\nkind = "{kind}"\nnode = "{node}"\nto = "saw"\ninterval = "{interval}"\nfrom = "{since}"\n'
    for node, since in (("press", "0s"), ("twin", "12s")) for kind, interval in (("arp", "2s"), ("ping", "3s"))
)  # fmt: skip


def one_address(scenario: str) -> list[Frame]:
    """Return the frames of a plant in which the twin has the address of the press."""
    return readdressed(frames_of(scenario), TWIN, PRESS)


def kinds(causes: list[Cause]) -> list[str]:
    return [cause.kind.name for cause in causes]


def test_both_send_a_list_and_each_counts_for_itself(tmp_path: Path) -> None:
    (cause,) = causes_in(one_address(PLANT + SENDS_TOO), tmp_path)
    assert cause.kind.name == "duplicate-address"
    assert cause.title == "Two devices have the address 10.0.0.1 since 10.0 s (list 1)"
    assert cause.severity == Severity.ERROR
    assert cause.until_ns is None
    assert "02:00:00:00:00:aa and 02:00:00:00:00:bb take turns" in cause.checked[0]
    assert cause.checked[1:] == ("the counters of each of them are regular, those of both together are not",)
    assert cause.findings


def test_vendors_tell_which_device_is_meant(tmp_path: Path) -> None:
    made = PLANT.replace("02:00:00:00:00:aa", "00:01:05:00:00:aa").replace("02:00:00:00:00:bb", "00:a0:45:00:00:bb")
    (cause,) = causes_in(one_address(made + SENDS_TOO), tmp_path)
    assert cause.checked[0].startswith(
        "hardware addresses 00:01:05:00:00:aa (Beckhoff Automation GmbH) and 00:a0:45:00:00:bb (PHOENIX CONTACT "
        "Electronics GmbH) take turns"
    )


def test_a_device_that_speaks_arp_alone_has_the_address_too(tmp_path: Path) -> None:
    arp = "".join(
        f'[[traffic]]\nkind = "arp"\nnode = "{node}"\nto = "saw"\ninterval = "2s"\nfrom = "{since}"\n'
        for node, since in (("press", "0s"), ("twin", "12s"))
    )
    (cause,) = causes_in(one_address(PLANT + arp), tmp_path)
    assert cause.title == "Two devices have the address 10.0.0.1 since 12.0 s (list 1)"
    assert (cause.until_ns, cause.checked[1:]) == (None, ("ARP tells both hardware addresses for it",))


def test_of_devices_that_send_no_list_arp_tells_and_nothing_need_be_wrong(tmp_path: Path) -> None:
    (cause,) = causes_in(one_address(PLANT + HAS_ARP), tmp_path)
    assert (cause.kind.name, cause.severity) == ("duplicate-address", Severity.ERROR)
    assert [finding.code for finding in cause.findings] == ["NV963"]
    assert cause.checked[1:] == ("ARP tells both hardware addresses for it",)


def test_it_is_over_when_one_of_them_is_gone(tmp_path: Path) -> None:
    (cause,) = causes_in(one_address(PLANT + SENDS_TOO + 'until = "15s"\n'), tmp_path)
    assert cause.title.startswith("Two devices have the address 10.0.0.1 from 10.0 s to 1")
    assert cause.until_ns is not None


def copied(frames: list[Frame], hardware: str, share: int = 100) -> list[Frame]:
    """Return frames of the press with copies that a router sends on, of so many in a hundred."""
    own = [frame for number, frame in enumerate(frames) if number % 100 < share and frame.data[26:30] == b"\n\0\0\1"]
    return [*frames, *(from_hardware(frame, hardware)._replace(ts_ns=frame.ts_ns + 50_000) for frame in own)]


def test_copies_by_a_router_are_no_device(tmp_path: Path) -> None:
    assert "duplicate-address" not in kinds(causes_in(copied(frames_of(PLANT), "02:00:00:00:00:cc"), tmp_path))


def in_turns(frames: list[Frame], hardware: tuple[str, str]) -> list[Frame]:
    """Return frames of which each is sent by another one of two hardware addresses than the one before."""
    return [
        from_hardware(frame, hardware[number % 2]) if frame.data[26:30] == b"\n\0\0\1" else frame
        for number, frame in enumerate(frames)
    ]


def test_one_device_with_two_cables_counts_regularly_over_both(tmp_path: Path) -> None:
    bond = in_turns(frames_of(PLANT), ("02:00:00:00:00:aa", "02:00:00:00:00:bb"))
    assert not causes_in(bond, tmp_path)


def test_two_addresses_are_a_second_sender(tmp_path: Path) -> None:
    assert kinds(causes_in(frames_of(PLANT + SENDS_TOO), tmp_path)) == ["second-sender"]


def test_a_device_that_was_replaced_sends_alone(tmp_path: Path) -> None:
    axis = PLANT.replace('sender = "press"', 'sender = "press"\nuntil = "12s"', 1)
    (cause,) = causes_in(one_address(axis + SENDS_TOO.replace("10s", "14s")), tmp_path)
    assert cause.kind.name == "node-restart"


@pytest.mark.parametrize("hosts", [3, 5])
def test_a_router_has_many_addresses_and_is_none_of_the_devices(hosts: int, tmp_path: Path) -> None:
    frames = one_address(PLANT + SENDS_TOO)
    behind = [
        from_hardware(frame, "02:00:00:00:00:bb")._replace(ts_ns=frame.ts_ns + 1000 * number)
        for number in range(1, hosts)
        for frame in readdressed(
            [one for one in frames if one.data[26:30] == b"\n\0\0\2"], "10.0.0.2", f"10.0.1.{number}"
        )
    ]
    assert "duplicate-address" not in kinds(causes_in([*frames, *behind], tmp_path))


@pytest.mark.parametrize("counter", ["stream", "telegram", "send"])
@pytest.mark.parametrize(
    ("event", "kind"),
    [
        ('[[restart]]\nnode = "press"\nat = "5s"\noutage = "2s"\n', "node-restart"),
        ('[[unplugged]]\nnode = "press"\nat = "3s"\nuntil = "7s"\n', "node-silent"),
    ],
)
def test_what_was_before_the_second_device_is_its_own_story(
    event: str, kind: str, counter: str, tmp_path: Path
) -> None:
    plant = PLANT.replace('"02:00:00:00:00:aa"', f'"02:00:00:00:00:aa"\ncounter = "{counter}"')
    feed = '[[list]]\nname = "feed"\nindex = 7\nsender = "press"\nbytes = [20]\ninterval = "70ms"\n'
    before, shared = sorted(
        causes_in(one_address(plant + feed + event + SENDS_TOO), tmp_path), key=lambda one: one.since_ns
    )
    assert (before.kind.name, shared.kind.name) == (kind, "duplicate-address")
    assert shared.title == "Two devices have the address 10.0.0.1 since 10.0 s (lists 1 and 7)"
    assert (before.until_ns or shared.since_ns) < shared.since_ns
