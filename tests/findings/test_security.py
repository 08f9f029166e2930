"""Senders that the project does not name, and two devices with one address; and what only looks so."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.causes.plants import from_hardware, readdressed
from tests.findings.security_plants import analysed, found_in, told_in
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import SECOND, A, B, C, Wire

PRESS, TWIN = "02:00:00:00:00:aa", "02:00:00:00:00:bb"
ALL = "255.255.255.255"


def plant() -> Wire:
    """Return two lists, the first from two nodes."""
    wire = Wire()
    for number in range(20):
        wire.data(number * SECOND, number + 1, source=A, list_id=1)
        wire.data(number * SECOND + 1000, number + 1, source=C, list_id=2)
        if number >= 5:
            wire.data(number * SECOND + 2000, number + 1, source=B, list_id=1)
    return wire


NAMED = f'[nodes]\n"{A}" = {{ name = "press", writes = [1] }}\n"{C}" = {{}}\n'


def test_who_is_not_named_as_the_sender_of_a_list_is_an_unknown_writer(tmp_path: Path) -> None:
    found = analysed(plant().frames, tmp_path, NAMED)
    (finding,) = [one for one in found.findings if one.code == "NV961"]
    assert finding.message == f"{B} sent 15 telegrams of this list: the project gives it to {A} alone."
    assert (finding.count, finding.first_ns, finding.frames) == (15, 5 * SECOND + 2000, (13,))
    assert (finding.last_ns, finding.frames_cut) == (19 * SECOND + 2000, 14)
    # It is the second sender, and told as nothing else.
    assert found.happened is not None
    (cause,) = found.happened.causes
    assert cause.kind.name == "second-sender"
    assert finding in cause.findings


@pytest.mark.parametrize(
    "project",
    [
        "",
        f'[nodes]\n"{A}" = {{ name = "press" }}\n',  # names alone say nothing of who sends
        f'[nodes]\n"{C}" = {{ writes = [2] }}\n',  # of another list
        f'[nodes]\n"{A}" = {{ writes = [1] }}\n"{B}" = {{ writes = ["udp/1202/1"] }}\n',  # a redundant pair
        f'[nodes]\n"{A}" = {{ writes = ["udp/1300/1"] }}\n',  # of a list on another port
        f'[nodes]\n"{A}" = {{}}\n"{B}" = {{}}\n"{C}" = {{}}\n[security]\nonly_nodes = true\n',
    ],
)
def test_nobody_is_unknown_where_the_project_does_not_say_so(project: str, tmp_path: Path) -> None:
    assert not told_in(plant().frames, tmp_path, project)


def test_where_the_project_names_all_nodes_every_other_one_is_unknown(tmp_path: Path) -> None:
    project = f'[nodes]\n"{A}" = {{}}\n[security]\nonly_nodes = true\n'
    assert told_in(plant().frames, tmp_path, project) == [
        ("NV961", f"{B} sent 15 telegrams of this list: [nodes] names all who send lists, and not this one.", 15),
        ("NV961", f"{C} sent 20 telegrams of this list: [nodes] names all who send lists, and not this one.", 20),
    ]


def test_a_sender_that_has_another_address_now_is_told_so(tmp_path: Path) -> None:
    (finding,) = found_in(plant().frames, tmp_path, f'[nodes]\n"{A}" = {{ writes = [2] }}\n')
    assert finding.message == f"{C} sent 20 telegrams of this list: the project gives it to {A} alone."
    assert finding.hint.startswith(f"{A} sent nothing of it in this capture: see whether it has another address now")


def test_very_many_unknown_writers_are_told_by_one_finding(tmp_path: Path) -> None:
    """As where somebody makes up senders."""
    frames = [
        data_frame(number * 1000, f"10.{number >> 8}.{number & 255}.9", ALL, telegram(counter=1))
        for number in range(3000)
    ]
    found = analysed(frames, tmp_path, f'[nodes]\n"{C}" = {{}}\n"{A}" = {{ writes = [1] }}\n')
    (finding,) = [one for one in found.findings if one.code == "NV961"]
    who = "3 000 nodes (10.0.0.9, 10.0.1.9, 10.0.2.9 and 2 997 more)"
    assert finding.message == f"{who} sent 3 000 telegrams of this list: the project gives it to {A} alone."
    assert (finding.node, finding.count, finding.frames) == (None, 3000, tuple(range(1, 11)))
    assert len(found_in(frames[:8], tmp_path, f'[nodes]\n"{A}" = {{ writes = [1] }}\n')) == 8


def arp(ts_ns: int, hardware: str, address: str, asked: str, *, answers: bool = False) -> Frame:
    """Return an ARP request of a device, or its answer to one."""
    sender, to = bytes.fromhex(hardware.replace(":", "")), bytes(6)
    own, other = (bytes(map(int, text.split("."))) for text in (address, asked))
    body = b"\0\1\x08\0\x06\x04\0" + (b"\2" if answers else b"\1") + sender + own + to + other
    return from_hardware(data_frame(ts_ns, address, ALL, b""), hardware)._replace(
        data=b"\xff" * 6 + sender + b"\x08\x06" + body, original=14 + len(body)
    )


def sent_by(hardware: str, times: range, *, first: int = 1, ttl_less: int = 0, value: int = 0) -> list[Frame]:
    """Return telegrams of one address from a hardware address, each step of 100 ms one further."""
    frames = []
    for counter, place in enumerate(times, first):
        data = telegram(counter=counter, data=bytes([counter & 0xFF, value]))
        frame = data_frame(place * SECOND // 10, A, ALL, data)
        for _ in range(1 + ttl_less):
            frame = from_hardware(frame, hardware)
        frames.append(frame)
    return frames


def test_two_devices_that_use_one_address_in_turns_are_told_with_their_hardware(tmp_path: Path) -> None:
    frames = sent_by(PRESS, range(60)) + sent_by(TWIN, range(61, 121), first=500, value=9)
    turns = [one._replace(ts_ns=one.ts_ns - 5_950_000_000) if one.ts_ns > 6 * SECOND else one for one in frames]
    found = analysed(turns, tmp_path)
    (finding,) = [one for one in found.findings if one.code == "NV963"]
    assert finding.message == (
        f"Two hardware addresses send from {A} in turns: {PRESS} (60 frames, 58 turns), {TWIN} (60 frames, 59 turns); "
        "the counters of each of them are regular, those of both together are not."
    )
    assert found.happened is not None
    assert [cause.kind.name for cause in found.happened.causes] == ["duplicate-address"]
    assert finding in found.happened.causes[0].findings


def test_two_devices_that_ask_by_arp_in_turns_are_told_too(tmp_path: Path) -> None:
    asks = [
        arp(number * SECOND + one * SECOND // 2, (PRESS, TWIN)[one], B, C) for number in range(10) for one in range(2)
    ]
    frames = [data_frame(number * SECOND, B, ALL, telegram(counter=number + 1)) for number in range(10)]
    (finding,) = found_in([*asks, *(from_hardware(one, PRESS) for one in frames)], tmp_path)
    assert finding.code == "NV963"
    assert finding.message.endswith("ARP tells both hardware addresses for it.")


def test_a_device_that_was_replaced_is_none_of_two(tmp_path: Path) -> None:
    """As after a change of hands by DHCP, or of a broken device: the one, then the other, and ARP of both."""
    frames = sent_by(PRESS, range(60)) + sent_by(TWIN, range(70, 130))
    arps = [arp(0, PRESS, A, B), arp(7 * SECOND, TWIN, A, B)]
    assert not told_in([*frames, *arps], tmp_path)


@pytest.mark.parametrize("switch_overs", [1, 4, 12])
def test_a_redundant_pair_that_takes_over_from_each_other_is_none_of_two(switch_overs: int, tmp_path: Path) -> None:
    frames: list[Frame] = []
    for turn in range(switch_overs + 1):
        begin, hardware = turn * 50, (PRESS, TWIN)[turn % 2]
        frames += sent_by(hardware, range(begin, begin + 50), first=begin + 1)
        frames.append(arp(begin * SECOND // 10, hardware, A, A))
    assert not told_in(frames, tmp_path)


def test_what_a_router_sends_on_is_none_of_two(tmp_path: Path) -> None:
    frames = sent_by(PRESS, range(60))
    copies = [from_hardware(one, TWIN)._replace(ts_ns=one.ts_ns + 50_000) for one in frames]
    assert not told_in([*frames, *copies], tmp_path)


def test_a_router_that_answers_arp_in_the_name_of_a_host_behind_it_is_none_of_two(tmp_path: Path) -> None:
    """Both sides of it are captured: what it sends on has one hop less before it."""
    frames: list[Frame] = []
    for number in range(20):
        (own,) = sent_by(PRESS, range(3 * number, 3 * number + 1), first=number + 1)
        behind = from_hardware(own, TWIN)._replace(ts_ns=own.ts_ns + SECOND // 10)
        asks = [arp(one.ts_ns + 1000, hardware, A, B) for one, hardware in ((own, PRESS), (behind, TWIN))]
        # Broadcast telegrams do not pass it: nothing of what it sends on is a copy.
        talk = data_frame(behind.ts_ns + 2000, A, B, b"no telegram")
        frames += [own, *asks, from_hardware(from_hardware(talk, TWIN), TWIN)]
    assert not told_in(frames, tmp_path)


def test_one_device_with_two_cables_is_none_of_two(tmp_path: Path) -> None:
    frames = sent_by(PRESS, range(60))
    bond = [from_hardware(one, (PRESS, TWIN)[number % 2]) for number, one in enumerate(frames)]
    assert not told_in(bond, tmp_path)


def test_one_device_with_two_cables_that_asks_by_arp_on_both_is_none_of_two(tmp_path: Path) -> None:
    """As a bond that shares out its load does."""
    frames = [from_hardware(one, (PRESS, TWIN)[number % 2]) for number, one in enumerate(sent_by(PRESS, range(200)))]
    asks = [
        arp(number * SECOND + one * SECOND // 2, (PRESS, TWIN)[one], A, B) for number in range(20) for one in range(2)
    ]
    assert not told_in([*frames, *asks], tmp_path)


def test_a_computer_that_answers_arp_on_both_of_its_cards_is_none_of_two(tmp_path: Path) -> None:
    """Linux does so where both are in one network: who looks for an address of it is answered twice."""
    answers = [
        arp(number * SECOND + 7 + one, (PRESS, TWIN)[one], A, B, answers=True)
        for number in range(20)
        for one in range(2)
    ]
    frames = sent_by(PRESS, range(200))
    assert not told_in([*frames, *answers], tmp_path)
    # Where it sends from both, too, each counting for itself, there are two.
    twin = [one._replace(ts_ns=one.ts_ns + SECOND // 20) for one in sent_by(TWIN, range(200), first=500, value=9)]
    assert {code for code, *_ in told_in([*frames, *answers, *twin], tmp_path)} == {"NV963"}


@pytest.mark.parametrize("virtual", ["00:00:5e:00:01:07", "00:00:0c:07:ac:01", "00:00:0c:9f:f0:01"])
def test_a_pair_that_shares_a_virtual_hardware_address_is_none_of_two(virtual: str, tmp_path: Path) -> None:
    """As with VRRP and HSRP: who holds the address announces the virtual one, and sends from its own, too."""
    frames = sent_by(PRESS, range(200))
    asks = [arp(number * SECOND // 2, (virtual, PRESS)[number % 2], A, B) for number in range(40)]
    assert not told_in([*frames, *asks], tmp_path)
    not_virtual = [arp(number * SECOND // 2, (TWIN, PRESS)[number % 2], A, B) for number in range(40)]
    assert told_in([*frames, *not_virtual], tmp_path)


def tagged(frame: Frame, vlan: int) -> Frame:
    data = frame.data[:12] + b"\x81\x00" + vlan.to_bytes(2, "big") + frame.data[12:]
    return frame._replace(data=data, original=frame.original + 4)


@pytest.mark.parametrize("vlan", [10, 20])
def test_like_machines_with_the_same_addresses_in_vlans_of_their_own_are_none_of_two(vlan: int, tmp_path: Path) -> None:
    """As a mirror of a trunk shows them; in one VLAN, they are two with one address."""
    frames = [tagged(one, 10) for one in sent_by(PRESS, range(200))]
    for one in sent_by(TWIN, range(200), first=500, value=9):
        frames.append(tagged(one._replace(ts_ns=one.ts_ns + SECOND // 20), vlan))
    found = analysed(frames, tmp_path)
    assert ("NV963" in {one.code for one in found.findings}) == (vlan == 10)
    assert found.happened is not None
    (cause,) = found.happened.causes
    assert cause.kind.name == "duplicate-address"
    apart = "each is in a VLAN of its own (10 and 20): networks that have the same addresses"
    assert (apart in cause.checked, "one VLAN" in cause.next) == (vlan == 20, vlan == 20)


def test_devices_without_an_address_do_not_share_one(tmp_path: Path) -> None:
    """Before a DHCP server answers, all of them send from 0.0.0.0."""
    frames = [*sent_by(PRESS, range(100)), *sent_by(TWIN, range(100), first=500, value=9)]
    frames = [one._replace(ts_ns=one.ts_ns + (number >= 100) * SECOND // 20) for number, one in enumerate(frames)]
    assert told_in(frames, tmp_path)
    assert not told_in(readdressed(frames, A, "0.0.0.0"), tmp_path)


def test_a_mirror_that_shows_frames_twice_shows_no_second_device(tmp_path: Path) -> None:
    frames = sent_by(PRESS, range(60))
    assert not told_in([*frames, *(one._replace(ts_ns=one.ts_ns + 2000) for one in frames)], tmp_path)


def test_hosts_behind_one_router_that_translates_addresses_are_none_of_two(tmp_path: Path) -> None:
    """They have one address, and one hardware address."""
    frames = sent_by(PRESS, range(60)) + sent_by(PRESS, range(100, 160), first=500, value=9)
    frames = [
        one._replace(ts_ns=one.ts_ns - 10 * SECOND + 50_000) if one.ts_ns >= 10 * SECOND else one for one in frames
    ]
    assert "NV963" not in {code for code, *_ in told_in(readdressed(frames, A, C), tmp_path)}
