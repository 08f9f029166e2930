"""Hosts that look for lists, and readers that only begin; what is found against a count of every minute."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.findings.asked_in_vain import Asked, dense
from nvscope.findings.scans import LEAST_LISTS, LEAST_PARTNERS, LEAST_PORTS
from tests.findings.security_plants import analysed, found_in, told_in
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.wire import BOOT_UP, SECOND, A, B, Wire

HOST = "10.0.0.99"
ALL = "255.255.255.255"


def asked(lists: range, *, within_s: int = 50, again: int = 1, subindexes: int = 1) -> list[Frame]:
    """Return boot-up requests of a host for lists, one behind the other."""
    frames = []
    for place, number in enumerate(lists):
        for time in range(again):
            at = SECOND + place * within_s * SECOND // len(lists) + time * 1000
            frames += [
                data_frame(at + subindex, HOST, ALL, telegram(BOOT_UP, number, subindex, counter=0, data=b""))
                for subindex in range(subindexes)
            ]
    return frames


def plant(lists: range = range(1, 3)) -> list[Frame]:
    wire = Wire()
    for second in range(70):
        for number in lists:
            wire.data(second * SECOND, second + 1, source=A, list_id=number)
    return wire.frames


def test_who_asks_for_a_hundred_lists_of_nobody_within_a_minute_scans(tmp_path: Path) -> None:
    found = analysed([*plant(), *asked(range(1, 201))], tmp_path)
    (finding,) = [one for one in found.findings if one.code == "NV966"]
    assert finding.message == (
        f"{HOST} asked for 198 lists that nobody sends (udp/1202/3, udp/1202/4, udp/1202/5 …), at least 100 of them "
        "within a minute."
    )
    assert (finding.count, len(finding.frames), finding.frames_cut) == (198, 10, 188)
    assert found.summary.addresses[finding.node or 0] == HOST


def test_what_a_scan_asks_for_in_vain_is_one_cause_not_one_a_list(tmp_path: Path) -> None:
    panel = [data_frame(2 * SECOND, B, ALL, telegram(BOOT_UP, 500, counter=0, data=b""))]
    found = analysed([*plant(), *asked(range(1, 201)), *panel], tmp_path)
    assert found.happened is not None
    told = {cause.title: {one.code for one in cause.findings} for cause in found.happened.causes}
    assert told == {
        f"Nobody answered node {HOST}, which asked for 198 lists from 1.5 s to 51.8 s": {"NV304", "NV966"},
        f"Nobody answered node {B}, which asked for list 500 at 2.0 s": {"NV304"},
    }


def test_what_a_reader_asks_for_in_vain_is_one_cause_where_it_is_much(tmp_path: Path) -> None:
    """As of a controller that is off when a panel begins: few lists have a cause each, which names them."""
    titles = {
        many: [cause.title for cause in found.happened.causes]
        for many in (8, 9)
        if (found := analysed([*plant(), *asked(range(10, 10 + many), within_s=1)], tmp_path)).happened is not None
    }
    assert titles[9] == [f"Nobody answered node {HOST}, which asked for 9 lists from 1.0 s to 2.9 s"]
    assert len(titles[8]) == 8
    assert f"Nobody answered node {HOST}, which asked for list 17 at 1.9 s" in titles[8]


def test_so_many_and_no_fewer_are_a_scan(tmp_path: Path) -> None:
    many = range(1000, 1000 + LEAST_LISTS)
    assert [code for code, *_ in told_in([*plant(), *asked(many)], tmp_path)] == ["NV966"]
    assert not told_in([*plant(), *asked(many[:-1])], tmp_path)
    # One list is one, however often it is asked for, and for how many SubIndexes.
    assert not told_in([*plant(), *asked(many[:-1], again=3, subindexes=4)], tmp_path)
    # Nor is a reader one that asks for them over an hour.
    assert not told_in([*plant(), *asked(many, within_s=3600)], tmp_path)


def test_a_reader_that_begins_asks_for_lists_that_are_sent(tmp_path: Path) -> None:
    lists = range(1, 151)
    assert not told_in([*plant(lists), *asked(lists)], tmp_path)


def test_a_reader_whose_senders_are_off_asks_for_lists_that_the_project_knows(tmp_path: Path) -> None:
    lists = range(1000, 1150)
    frames = [*plant(), *asked(lists)]
    reads = ", ".join(map(str, lists))
    assert not told_in(frames, tmp_path, f'[nodes]\n"{HOST}" = {{ reads = [{reads}] }}')
    assert not told_in(frames, tmp_path, "".join(f'[lists.{number}]\nname = "l{number}"\n' for number in lists))
    assert told_in(frames, tmp_path)


def on_ports(ports: range, service: int, *, answered: bool = False) -> list[Frame]:
    frames = []
    for place, port in enumerate(ports):
        at = SECOND + place * SECOND
        request = telegram(service, 7, counter=place, data=b"")
        frames.append(data_frame(at, HOST, B, request, port=port, source_port=50_000))
        if answered:
            reply = telegram(2, 7, counter=place)
            frames.append(data_frame(at + 1000, B, HOST, reply, port=50_000, source_port=port))
    return frames


@pytest.mark.parametrize("service", [BOOT_UP, 1])
def test_who_asks_in_vain_on_twenty_ports_scans(service: int, tmp_path: Path) -> None:
    ports = range(2000, 2000 + LEAST_PORTS)
    (finding,) = found_in([*plant(), *on_ports(ports, service)], tmp_path)
    assert finding.message == (
        f"{HOST} asked in vain on 20 ports (2000, 2001, 2002 …), at least 20 of them within a minute."
    )
    assert not told_in([*plant(), *on_ports(ports[:-1], service)], tmp_path)


def test_a_gateway_that_is_answered_on_every_port_scans_none(tmp_path: Path) -> None:
    assert not told_in([*plant(), *on_ports(range(2000, 2030), 1, answered=True)], tmp_path)


def of_addresses(many: int, *, begin: int = 0, replying: int = 0, broadcast: bool = False) -> list[Frame]:
    """Return requests for a parameter of many addresses, or of one network after the other, and some replies."""
    frames = []
    for place in range(begin, begin + many):
        at, partner = SECOND + place * SECOND // 10, f"10.1.{place}.255" if broadcast else f"10.1.0.{place + 1}"
        request = telegram(1, 7, counter=place, data=b"")
        frames.append(data_frame(at, HOST, partner, request))
        if place < replying:
            frames.append(data_frame(at + 1000, partner, HOST, telegram(23, 7, counter=place)))
    return frames


def test_who_asks_a_hundred_addresses_of_which_none_replies_scans(tmp_path: Path) -> None:
    (finding,) = found_in([*plant(), *of_addresses(LEAST_PARTNERS + 3, replying=3)], tmp_path)
    assert finding.message == (
        f"{HOST} asked 100 addresses for parameters, of which not one replied (10.1.0.4, 10.1.0.5, 10.1.0.6 …), at "
        "least 100 of them within a minute."
    )
    assert (finding.count, len(finding.frames)) == (LEAST_PARTNERS, 10)
    assert not told_in([*plant(), *of_addresses(LEAST_PARTNERS + 3, replying=4)], tmp_path)


def test_partners_that_are_known_are_not_looked_for(tmp_path: Path) -> None:
    frames = [*plant(), *of_addresses(LEAST_PARTNERS)]
    assert told_in(frames, tmp_path)
    assert not told_in(frames, tmp_path, '[nodes]\n"10.1.0.7" = { name = "press" }')
    list_of_one = data_frame(2 * SECOND, "10.1.0.8", ALL, telegram(list_id=9))
    assert not told_in([*frames, list_of_one], tmp_path)
    # Whoever replies to somebody is there, and does not reply to everybody.
    spoken = telegram(1, 8, counter=1, data=b""), telegram(2, 8, counter=1)
    other = [data_frame(SECOND, A, "10.1.0.9", spoken[0]), data_frame(SECOND + 9, "10.1.0.9", A, spoken[1])]
    assert not told_in([*frames, *other], tmp_path)


def rounds(partners: range, times: int) -> list[Frame]:
    """Return requests of a host for the same parameter of all of some partners, one round behind the other."""
    asked = [(time, place) for time in range(times) for place in partners]
    return [
        data_frame(SECOND + at * SECOND // 10, HOST, f"10.1.0.{place}", telegram(1, 7, counter=time, data=b""))
        for at, (time, place) in enumerate(asked)
    ]


def test_who_polls_a_hundred_partners_of_which_no_reply_is_captured_looks_for_none(tmp_path: Path) -> None:
    """As a mirror of one direction shows it. Who tries each address three times before the next one does not poll."""
    partners = range(1, LEAST_PARTNERS + 1)
    assert [len(told_in([*plant(), *rounds(partners, times)], tmp_path)) for times in (1, 2, 3, 8)] == [1, 1, 0, 0]
    tried = [frame for place in partners for frame in rounds(range(place, place + 1), 3)]
    tried = [frame._replace(ts_ns=SECOND + at * SECOND // 10) for at, frame in enumerate(tried)]
    assert len(told_in([*plant(), *tried], tmp_path)) == 1
    # Nor is a host that polls some, and looks for many others.
    some = [frame._replace(ts_ns=frame.ts_ns + 9 * SECOND) for frame in rounds(range(120, 230), 1)]
    assert len(told_in([*plant(), *rounds(range(1, 31), 8), *some], tmp_path)) == 1


def test_what_goes_to_everybody_asks_no_address(tmp_path: Path) -> None:
    assert not told_in([*plant(), *of_addresses(LEAST_PARTNERS, broadcast=True)], tmp_path)


def test_a_mirror_that_shows_requests_twice_makes_no_scan_of_half_as_many(tmp_path: Path) -> None:
    frames = [*plant(), *asked(range(1000, 1060))]
    assert not told_in([*frames, *(one._replace(ts_ns=one.ts_ns + 2000) for one in frames)], tmp_path)


@examples(200)
@given(times=st.lists(st.integers(0, 40), max_size=40), least=st.integers(1, 6), within=st.integers(0, 10))
def test_what_is_dense_is_in_some_span_with_as_many(times: list[int], least: int, within: int) -> None:
    rows = [Asked(time, number, str(number)) for number, time in enumerate(times)]
    expected = sorted(
        one for one in rows
        if any(
            begin <= one.first_ns <= begin + within
            and sum(begin <= other <= begin + within for other in times) >= least
            for begin in times
        )
    )  # fmt: skip
    assert list(dense(rows, least, within)) == expected
