"""Transactions: what became of each request, the same however a capture is cut; what is secret stays so."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from dissectors.webvisu import UNREADABLE
from nvscope.analysis.transactions import visu_transactions
from nvscope.analysis.transactions.parameter_transactions import ParameterTransactions
from nvscope.analysis.transactions.recent_transactions import KEPT, RecentTransactions
from nvscope.analysis.transactions.transaction import Group, Outcome, Pair, Protocol, Room, Transaction
from nvscope.analysis.transactions.visu_transactions import VisuTransactions
from nvscope.definition.parameters import ParameterDefinition, Parameters
from nvscope.definition.scalars import SCALARS
from nvscope.engine.run import run
from nvscope.engine.told import Told
from tests.analysis.transactions.talk import NAMES, PANEL, PRESS, SERVICE, both, post, reply, sdo_talk, visu_talk
from tests.laws import examples, some
from tests.oracle.builders import MILLISECOND, SECOND, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.parameter_traffic import parameter_traffic
from tests.oracle.tcp_line import Line
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import Batches, batch_of, cut
from tests.tracker.visu.followed import reading

ROOM = Room(said=20, characters=120)
SEEDS = st.integers(0, 20_000)


class Everything:
    """An observer that keeps all transactions."""

    by_stream = True

    def __init__(self, parameters: Parameters | None = None, room: Room = ROOM) -> None:
        self._sources = ParameterTransactions(parameters, room), VisuTransactions(room)
        self.found: list[Transaction] = []
        self.asked: Counter[Pair] = Counter()

    def observe(self, told: Told) -> None:
        for source in self._sources:
            brought = source.of(told)
            self.found += brought.transactions
            self.asked.update(brought.pairs[pair] for pair in brought.pair.tolist())


def watched(batches: Iterable[PacketBatch], *observers: Any) -> None:
    for _ in run(Batches(batches), reading(), observers):
        pass


def transactions(frames: list[Frame], size: int = 1 << 20, **how: Any) -> list[Transaction]:
    """Return all of them, those of one protocol behind those of the other."""
    found = Everything(**how)
    watched(cut(batch_of(frames), size), found)
    return sorted(found.found, key=lambda one: one.pair.protocol)


def lines(found: Iterable[Transaction]) -> list[str]:
    """Return transactions as a person reads them."""
    return [
        " ".join([
            f"{one.frame}", *([] if one.asked_frame in (None, one.frame) else [f"({one.asked_frame})"]),
            "write" if one.writes else "read", one.outcome.value,
            *(f"{said.name}={said.old_text}→{said.text}" if one.writes else f"{said.name}={said.text}"
              for said in one.said),
            *([] if one.latency_ns is None else [f"{one.latency_ns // MILLISECOND} ms"]), *filter(None, [one.detail]),
        ])
        for one in found
    ]  # fmt: skip


VISU_LINES = [
    "7 (6) read answered PRG.rSpeed=21.5 .CurrentPassword=(hidden) PRG.sText=on 1 ms",
    "8 write open PRG.rSpeed=21.5→30.25",
    "9 (8) write confirmed PRG.rSpeed=21.5→30.25 7 ms",
    "10 write open PRG.rSpeed=30.25→99",
    "11 (10) write refused PRG.rSpeed=30.25→99 1 ms",
    "13 (12) read answered PRG.rSpeed=30.25 2001 ms",
    "14 write open .CurrentPassword=(hidden)→(hidden)",
    "15 (14) write confirmed .CurrentPassword=(hidden)→(hidden) 1 ms",
    "16 read unanswered PRG.rSpeed=None",
]
SDO_LINES = [
    "2 (1) read answered 0x2000:1=05 00 3 ms",
    "3 write open 0x2000:1=05 00→06 00",
    "4 (3) write confirmed 0x2000:1=05 00→06 00 2 ms",
    "5 write open 0x2000:1=06 00→07 00",
    "6 (5) write refused 0x2000:1=06 00→07 00 4 ms ODErrorReplyAccess",
    "7 read unanswered 0x2001:1=None",
    "8 read unexpected 0x2000:1=06 00",
]


@pytest.mark.parametrize("size", [1, 2, 3, 5, 100])
def test_a_page_that_reads_and_writes(size: int) -> None:
    found = transactions(visu_talk(), size)
    assert lines(found) == VISU_LINES
    assert {one.pair for one in found} == {Pair(Protocol.VISU, PANEL, PRESS, 80)}


@pytest.mark.parametrize("size", [1, 2, 3, 100])
def test_a_tool_that_asks_for_parameters(size: int) -> None:
    found = transactions(sdo_talk(), size)
    assert lines(found) == SDO_LINES
    assert {one.pair for one in found} == {Pair(Protocol.SDO, SERVICE, PRESS, 1202)}
    assert [one.known_frame for one in found if one.outcome is Outcome.UNANSWERED] == [8]


def test_parameters_have_the_names_and_types_of_the_project() -> None:
    known = Parameters((ParameterDefinition(0x2000, 1, "Ramp", SCALARS["INT"]),))
    found = transactions(sdo_talk(), parameters=known)
    assert lines(found)[:3] == [
        "2 (1) read answered Ramp=5 3 ms", "3 write open Ramp=5→6", "4 (3) write confirmed Ramp=5→6 2 ms",
    ]  # fmt: skip
    assert [(said.value, said.old) for one in found[1:2] for said in one.said] == [(6, 5)]


def test_what_no_controller_could_read_is_no_value() -> None:
    assert visu_transactions._UNREADABLE == UNREADABLE
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    for reply_to_read in ("|5|", "|???|"):
        line.ask(post("|0|1|0|4|0|2|1|")).answer(reply(reply_to_read))
        line.ask(post("|1|1|0|4|0|2|1|7|")).answer(reply("|1|"))
    found = transactions(line.frames)
    assert [said.value for said in found[3].said] == [None]
    assert lines(found) == [
        "5 (4) read answered 4,0,2,1=5 1 ms", "6 write open 4,0,2,1=5→7", "7 (6) write refused 4,0,2,1=5→7 1 ms",
        "9 (8) read answered 4,0,2,1=??? 1 ms", "10 write open 4,0,2,1=None→7",
        "11 (10) write refused 4,0,2,1=None→7 1 ms",
    ]  # fmt: skip


def test_a_value_that_turns_out_to_be_a_password_is_hidden_from_then_on() -> None:
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    line.ask(post("|0|1|0|4|8|41|4|")).answer(reply("|1234|"))  # no STRING, and nobody has named it yet
    line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES.replace(b"4,8,41,8", b"4,8,41,4")))
    line.ask(post("|1|1|0|4|8|41|4|99|")).answer(reply("|0|"))
    told = lines(transactions(line.frames))
    assert told[1:] == [
        "8 write open .CurrentPassword=(hidden)→(hidden)",
        "9 (8) write confirmed .CurrentPassword=(hidden)→(hidden) 1 ms",
    ]  # fmt: skip


def test_texts_are_told_in_the_encoding_of_the_page_old_ones_too() -> None:
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    line.ask(post("|0|1|0|4|60|81|8|")).answer(reply("|Größe|".encode()))
    page = b'<param name="ENCODINGSTRING" value="UTF-8">'
    line.ask(b"GET /plc/webvisu.htm HTTP/1.1\r\n\r\n").answer(reply(page))
    line.ask(post("|1|1|0|4|60|81|8|" + "5 €".encode().decode("latin-1") + "|")).answer(reply("|0|"))
    (said,) = [one.said[0] for one in transactions(line.frames) if one.outcome is Outcome.CONFIRMED]
    assert (said.name, said.old, said.value) == ("PRG.sText", "Größe", "5 €")


def test_without_its_list_of_names_a_text_may_be_a_password() -> None:
    told = " ".join(lines(transactions(visu_talk(names=False))))
    assert "4,0,4,6=21.5 4,8,41,8=(hidden) 4,60,81,8=(hidden)" in told
    assert not any(word in told for word in ("secret", "new"))


def test_what_is_longer_than_there_is_room_for_is_cut_and_what_is_more_is_counted() -> None:
    found = transactions(visu_talk(text="x" * 300), room=Room(said=2, characters=10))
    assert (len(found[0].said), found[0].left_out) == (2, 1)
    found = transactions(visu_talk(text="x" * 300), room=Room(said=3, characters=10))
    assert found[0].said[2].text == "x" * 9 + "…"


@pytest.mark.parametrize("seed", some(range(60)))
def test_any_cut_gives_the_same(seed: int) -> None:
    frames = visu_traffic(seed) if seed % 2 else parameter_traffic(seed)
    assert transactions(frames, 1 + seed % 7) == transactions(frames)


@examples(60)
@given(seed=SEEDS, size=st.integers(1, 90), of_pages=st.booleans())
def test_so_it_is_of_any_traffic(seed: int, size: int, of_pages: bool) -> None:
    frames = visu_traffic(seed) if of_pages else parameter_traffic(seed)
    assert transactions(frames, size) == transactions(frames)


def last_of(found: Iterable[Transaction], pair: Pair) -> list[Transaction]:
    """Return what should be kept of all transactions: the last ones of each group, and no write twice."""
    kept: dict[Group, list[Transaction]] = {group: [] for group in Group}
    for one in found:
        if one.pair != pair:
            continue
        last = kept[one.group]
        if one.writes and one.outcome is not Outcome.OPEN and one.asked_frame is not None:
            asked = [at for at, two in enumerate(last) if two.outcome is Outcome.OPEN]
            asked = [at for at in asked if last[at].asked_frame == one.asked_frame]
            if asked:
                del last[asked[-1]]
        last.append(one)
        del last[:-KEPT]
    return sorted((one for last in kept.values() for one in last), key=lambda one: one.known_frame)


@examples(60)
@given(seed=SEEDS, size=st.integers(1, 90), of_pages=st.booleans())
def test_of_each_pair_the_last_ones_are_kept(seed: int, size: int, of_pages: bool) -> None:
    frames = visu_traffic(seed) if of_pages else parameter_traffic(seed)
    recent, everything = RecentTransactions(), Everything()
    watched(cut(batch_of(frames), size), recent, everything)
    seen = recent.seen()
    assert set(everything.asked) <= set(seen.numbers)
    for pair in seen.numbers:
        assert list(seen.of(pair).transactions) == last_of(everything.found, pair)


def test_how_many_ask_a_second_is_told_of_whole_seconds() -> None:
    recent = RecentTransactions()
    frames = both()
    watched([batch_of([*frames, *(one._replace(ts_ns=one.ts_ns + 3 * 10**9) for one in sdo_talk())])], recent)
    seen = recent.seen()
    page = seen.of(Pair(Protocol.VISU, PANEL, PRESS, 80))
    assert page.per_s == pytest.approx(2 / 4)  # the second in which it began is no whole one of it
    assert page.last_write is not None
    assert lines([page.last_write]) == ["22 (21) write confirmed .CurrentPassword=(hidden)→(hidden) 1 ms"]
    assert seen.of(Pair(Protocol.VISU, PRESS, PANEL, 80)).transactions == ()


@pytest.mark.parametrize("size", [1, 2, 100])
def test_a_client_that_gave_up_is_seen_as_soon_as_time_has_passed(size: int) -> None:
    """Nothing more comes over the ports of pages; a write is told over what it wrote."""
    line = Line((PANEL, 50_000), (PRESS, 80), now=START).open()
    line.ask(post("|0|1|0|4|0|4|6|")).answer(reply("|21.5|")).ask(post("|1|1|0|4|0|4|6|30.25|")).close(True)
    closed_ns = line.frames[-1].ts_ns
    more = [data_frame(closed_ns + second * SECOND, SERVICE, PRESS, telegram(1)) for second in range(1, 13)]
    recent = RecentTransactions()
    watched(cut(batch_of([*line.frames, *more[:9]]), size), recent)
    (_, write) = recent.seen().of(Pair(Protocol.VISU, PANEL, PRESS, 80)).transactions
    assert write.outcome is Outcome.OPEN
    recent = RecentTransactions()
    watched(cut(batch_of([*line.frames, *more]), size), recent)
    (_, write) = recent.seen().of(Pair(Protocol.VISU, PANEL, PRESS, 80)).transactions
    assert lines([write]) == ["6 write unanswered 4,0,4,6=21.5→30.25"]
    assert (write.time_ns, write.known_frame) == (closed_ns + 10 * SECOND, len(line.frames) + 10)
