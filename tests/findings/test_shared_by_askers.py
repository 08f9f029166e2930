"""Two devices with one address that only ask: for parameters, or for pages; and one device that looks like two."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import pytest

from tests.causes.plants import frames_of, from_hardware
from tests.findings.security_plants import analysed, told_in
from tests.findings.test_security import PRESS, TWIN, arp
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import SECOND, A, B, C

READ, REPLY = 1, 2
BY_REQUESTS = "the counters of the requests of each of them are regular, those of both together are not."
BY_ARP = "ARP tells both hardware addresses for it."


def asked(place: int, counter: int, hardware: str, partner: str = B, *, index: int = 0x2000) -> list[Frame]:
    """Return a request from a hardware address, and its reply: each step of 100 ms one further."""
    at = place * SECOND // 10
    request = data_frame(at, A, partner, telegram(READ, index, 1, counter=counter, data=b""))
    reply = data_frame(at + 1_000_000, partner, A, telegram(REPLY, index, 1, counter=counter))
    return [from_hardware(request, hardware), reply]


def in_turns(counters: tuple[count[int], count[int]], places: int = 120) -> list[Frame]:
    """Return requests of two hardware addresses that take turns, each with the next of its counters."""
    return [
        frame for place in range(places)
        for frame in asked(place, next(counters[place % 2]) % 65_536, (PRESS, TWIN)[place % 2])
    ]  # fmt: skip


def by_arp(*, answers: tuple[bool, bool] = (False, False)) -> list[Frame]:
    return [
        arp(number * SECOND + one * SECOND // 2, (PRESS, TWIN)[one], A, B, answers=answers[one])
        for number in range(12) for one in range(2)
    ]  # fmt: skip


def test_two_that_ask_for_parameters_each_with_a_counter_of_its_own_are_told(tmp_path: Path) -> None:
    found = analysed(in_turns((count(1), count(500))), tmp_path)
    (finding,) = found.findings
    assert (finding.code, finding.message.split("; ")[1]) == ("NV963", BY_REQUESTS)
    assert found.happened is not None
    (cause,) = found.happened.causes
    assert (cause.kind.name, cause.findings) == ("duplicate-address", (finding,))
    assert cause.title == f"Two devices have the address {A} since 0.1 s"


def test_so_are_two_that_count_over_all_that_they_ask_for(tmp_path: Path) -> None:
    frames, counters = [], (count(1), count(500))
    for place in range(240):
        own = place % 2
        frames += asked(place, next(counters[own]), (PRESS, TWIN)[own], (B, C)[place // 2 % 2], index=place // 2 % 3)
    assert [code for code, *_ in told_in(frames, tmp_path)] == ["NV963"]


@pytest.mark.parametrize("with_arp", [False, True])
def test_one_device_with_two_cables_counts_regularly_over_both(with_arp: bool, tmp_path: Path) -> None:
    counter = count(65_500)
    assert not told_in([*in_turns((counter, counter)), *(by_arp() if with_arp else [])], tmp_path)


def test_a_device_that_asks_each_partner_over_a_cable_of_its_own_is_none_of_two(tmp_path: Path) -> None:
    """As a bond that shares out its load by address does; its program counts for each partner by itself."""
    frames, counters = [], (count(1), count(500))
    for place in range(120):
        frames += asked(place, next(counters[place % 2]), (PRESS, TWIN)[place % 2], (B, C)[place % 2])
    assert not told_in(frames, tmp_path)
    # It answers who looks for it on the one or the other, and asks on one alone.
    assert not told_in([*frames, *by_arp(answers=(False, True))], tmp_path)
    (told,) = told_in([*frames, *by_arp()], tmp_path)
    assert told[1].endswith(BY_ARP)


@pytest.mark.parametrize("switch_overs", [1, 4, 12])
def test_a_pair_that_takes_over_from_each_other_is_none_of_two(switch_overs: int, tmp_path: Path) -> None:
    frames = []
    for turn in range(switch_overs + 1):
        hardware = (PRESS, TWIN)[turn % 2]
        frames.append(arp(turn * 5 * SECOND, hardware, A, A))
        for place in range(turn * 50, turn * 50 + 50):
            frames += asked(place, place - turn * 50 + 1, hardware)
    assert not told_in(frames, tmp_path)


def test_what_a_router_sends_on_is_none_of_two_however_many_wait_for_replies(tmp_path: Path) -> None:
    counter = count(1)
    frames = in_turns((counter, counter))
    own = [from_hardware(one, PRESS) for one in frames[::2]]
    copies = [from_hardware(one, TWIN)._replace(ts_ns=one.ts_ns + SECOND * 3 // 20) for one in own]
    found = analysed([*own, *copies, *frames[1::2]], tmp_path)
    assert found.happened is not None
    assert not {"NV963"} & {one.code for one in found.findings}
    assert "duplicate-address" not in {one.kind.name for one in found.happened.causes}


def test_who_has_no_counter_says_nothing_by_it(tmp_path: Path) -> None:
    frames = in_turns((count(7, 0), count(7, 0)))
    assert not told_in(frames, tmp_path)
    (told,) = told_in([*frames, *by_arp()], tmp_path)
    assert told[1].endswith(BY_ARP)


PAGE = """
title = "a panel"
duration = "12s"
[[node]]
name = "oven"
address = "10.0.0.2"
[[node]]
name = "panel"
address = "10.0.0.1"
[[page]]
node = "panel"
to = "oven"
values = ["450.5"]
interval = "200ms"
[page.variables]
"PLC_PRG.rZone1" = "4,0,4,6"
"""


def test_two_that_ask_for_pages_are_told_where_both_ask_by_arp(tmp_path: Path) -> None:
    """Each connection is of one of them, as a browser opens one for each request."""
    frames = [
        from_hardware(one, (PRESS, TWIN)[one.data[35] % 2]) if one.data[26:30] == b"\x0a\0\0\1" else one
        for one in frames_of(PAGE)
    ]
    begin = frames[0].ts_ns
    asks, answers = (
        [one._replace(ts_ns=one.ts_ns + begin) for one in by_arp(answers=(False, late))] for late in (False, True)
    )
    (told,) = told_in([*frames, *asks], tmp_path)
    assert (told[0], told[1].endswith(BY_ARP)) == ("NV963", True)
    assert not told_in(frames, tmp_path)
    assert not told_in([*frames, *answers], tmp_path)
