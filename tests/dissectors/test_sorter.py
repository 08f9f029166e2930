"""Telling packets by varieties is the same as dissecting each of them, for any traffic, cut and memory."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

import dissectors.sorter
from dissectors.addresses import addresses_of
from dissectors.batch import PacketBatch
from dissectors.netvar import Fault, PortRules, dissect
from dissectors.sorter import Sorter
from dissectors.transport import DatagramBatch
from dissectors.varieties import NO_TELEGRAM
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import tcp_frame
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of

LEFT_OPEN = {"row", "payload", "source_port"}


def traffic(seed: int) -> list[Frame]:
    frames = generate(seed, frames=300, link=[1, 1, 1, None][seed % 4])
    return mutate(seed, frames) if seed % 2 else frames


def check(sorter: Sorter, packets: PacketBatch, ports: PortRules | None = None) -> None:
    """Compare what is told of each packet with what dissecting the whole batch finds."""
    told = sorter.sort(packets)
    expected = dissect(packets, ports)
    telegrams = expected.telegrams
    row = telegrams.datagram.row
    assert np.flatnonzero(told.variety != NO_TELEGRAM).tolist() == row.tolist()
    part, common = told.varieties.part[told.variety[row]], told.varieties.telegrams
    assert common.fault[part].tolist() == telegrams.fault.tolist()
    assert common.truncated[part].tolist() == telegrams.truncated.tolist()
    for column in fields(DatagramBatch):
        if column.name not in LEFT_OPEN:
            found = getattr(common.datagram, column.name)[part]
            assert found.tolist() == getattr(telegrams.datagram, column.name).tolist(), column.name
    whole = (telegrams.fault != Fault.HEADER_CUT) & (telegrams.fault != Fault.SHORT)
    header = common.header[part]
    for name in header.dtype.names or ():
        if name == "counter":
            assert told.counter[row][whole].tolist() == telegrams.header[name][whole].tolist()
        else:
            known = slice(None) if name in ("identity", "id", "index", "subindex") else whole
            assert header[name][known].tolist() == telegrams.header[name][known].tolist(), name
    at = told.packets.offset[row] + common.datagram.payload[part]
    for place, (start, length) in enumerate(zip(at, telegrams.datagram.captured_bytes, strict=True)):
        assert told.packets.data[start : start + length].tobytes() == telegrams.payload(place)
    assert told.fragments == expected.peeled.fragments
    assert told.quoted.datagram.row.tolist() == expected.quoted.datagram.row.tolist()


@pytest.mark.parametrize("seed", range(40))
def test_told_is_dissected(seed: int) -> None:
    packets = batch_of(traffic(seed))
    sorter = Sorter()
    check(sorter, packets)
    check(sorter, packets)  # all recognised now
    for begin in range(0, len(packets), 37):
        check(sorter, packets[begin : begin + 37])


def test_packets_of_one_header_come_by_one_way() -> None:
    """From one sender, by hardware address and way, and they are of one variety; numbers are by first appearance.

    Of what is no telegram, it is enough who sent it: where that is told, on Ethernet and IPv4, it has a number.
    """
    numbered = 0
    for seed in range(12):
        packets = batch_of(traffic(seed))
        sorter = Sorter()
        ways: dict[int, tuple[int, ...]] = {}
        latest = [0, 0]
        for begin in range(0, len(packets), 61):
            part = packets[begin : begin + 61]
            told, found = sorter.sort(part), addresses_of(part)
            columns = (found.hardware, found.vlan, found.high, found.low, found.ttl)
            way = dict(zip(found.row.tolist(), zip(*(one.tolist() for one in columns), strict=True), strict=True))
            for row in np.flatnonzero(told.header).tolist():
                number, seen = int(told.header[row]), (int(told.variety[row]), *way[row])
                is_other = int(told.variety[row] == NO_TELEGRAM)
                assert number in ways or number > latest[is_other]
                latest[is_other] = max(latest[is_other], number)
                assert ways.setdefault(number, seen) == seen
        numbered += all(latest)
    assert numbered > 3


def by_appearance(numbers: list[int]) -> list[int]:
    """Number anew what is numbered, in the order in which it appears; 0 stays."""
    new = {0: 0}
    return [new.setdefault(one, len(new)) for one in numbers]


def test_packets_of_one_sender_that_are_no_telegrams_have_one_number() -> None:
    frames = [
        tcp_frame(row, (f"10.0.0.{row % 3 + 1}", 50_000 + row), ("10.0.0.5", 443), data=bytes(row)) for row in range(30)
    ]
    told = Sorter().sort(batch_of(frames))
    assert told.header.tolist() == [row % 3 + 1 for row in range(30)]
    assert not told.variety.any()


def test_who_forges_senders_crowds_nobody_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dissectors.sorter, "MOST_SENDERS", 5)
    forged = [tcp_frame(row, (f"10.0.1.{row + 1}", 50_000), ("10.0.0.5", 443)) for row in range(20)]
    telegrams = traffic(4)
    expected, sorter = Sorter().sort(batch_of(telegrams)), Sorter()
    assert sorter.sort(batch_of(forged)).header.tolist() == [1, 2, 3, 4, 5] + [0] * 15
    found = sorter.sort(batch_of(telegrams))
    assert found.variety.tolist() == expected.variety.tolist()
    told = np.flatnonzero(expected.variety)
    assert (found.header[told] > 0).tolist() == (expected.header[told] > 0).tolist()
    assert (found.header[told] > 0).any()


@pytest.mark.parametrize("seed", range(8))
def test_how_many_are_looked_up_at_a_time_changes_no_number(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    packets = batch_of(traffic(seed))
    at_once = Sorter().sort(packets)
    monkeypatch.setattr(dissectors.sorter, "BLOCK", 4)
    sorter = Sorter()
    few = sorter.sort(packets)
    assert few.variety.tolist() == at_once.variety.tolist()
    assert few.counter.tolist() == at_once.counter.tolist()
    assert few.varieties.part.tolist() == at_once.varieties.part.tolist()
    check(sorter, packets)


@pytest.mark.parametrize("seed", range(16))
def test_telegrams_among_many_others_are_told_alike(seed: int) -> None:
    frames = traffic(seed)
    usual, once = Sorter(), batch_of(frames)
    # Of a port that nobody asks for, and so many that telegrams are few.
    other = tcp_frame(0, ("10.0.0.1", 50_000), ("10.0.0.5", 443), data=b"something else")
    among = [one for frame in frames for one in (frame, *[other._replace(ts_ns=frame.ts_ns)] * 9)]
    sorter = Sorter()
    for _ in range(2):
        expected, found = usual.sort(once), sorter.sort(batch_of(among))
        assert found.variety[::10].tolist() == expected.variety.tolist()
        assert by_appearance(found.header[::10].tolist()) == by_appearance(expected.header.tolist())
        assert np.count_nonzero(found.variety) == np.count_nonzero(expected.variety)
        check(sorter, batch_of(among))


@pytest.mark.parametrize("seed", range(6))
def test_little_memory_changes_nothing(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dissectors.sorter, "MOST_VARIETIES", 5)
    packets = batch_of(traffic(seed))
    sorter = Sorter()
    for begin in range(0, len(packets), 11):
        check(sorter, packets[begin : begin + 11])


@pytest.mark.parametrize("seed", range(6))
def test_ports_decided_by_hand(seed: int) -> None:
    packets = batch_of(traffic(seed))
    ports = PortRules(telegrams=(53, 1300), others=(1202,))
    check(Sorter(ports), packets, ports)


def test_traffic_in_which_nothing_recurs_does_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dissectors.sorter, "MOST_VARIETIES", 50)
    sorter = Sorter()
    for seed in range(20):
        told = sorter.sort(batch_of(mutate(seed, generate(seed, frames=40, link=1))))
        assert len(told.varieties) <= 50 + 40 + 1
