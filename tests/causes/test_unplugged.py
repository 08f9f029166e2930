"""A capturing computer without its cable saw nothing: nobody in the plant is blamed for that."""

from __future__ import annotations

from collections.abc import Sequence

from dissectors.batch import PacketBatch
from nvscope.analysis.snapshot import snapshot
from nvscope.capture.source import SourceInfo
from nvscope.causes.cause import Cause
from nvscope.definition.project import Project
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.evidence.witness import Witness
from nvscope.tracker.state import TrackerState
from tests.definition.lists import telegram
from tests.packets import Batches, batch_of
from tests.records import replace

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000
SECOND_NS = 1000 * MS
ETH0 = SourceInfo("eth0", "interface", is_live=True)
Spans = Sequence[tuple[int, int | None]]


def causes(
    silent: tuple[float, float], without: Sequence[Spans], *, until_s: float = 20,
    stopped_before_s: float | None = None, slow: bool = False,
) -> list[Cause]:  # fmt: skip
    """Return the causes of two lists, each sent every 50 ms but for a time; ``without`` are times of no carrier.

    Counters go on meanwhile. ``stopped_before_s``: the second list ends there; ``slow``: it is sent once a second.
    """
    frames = []
    for number in range(int(until_s * 20)):
        at_ns = START_NS + number * 50 * MS
        for list_id in (7, 8):
            second = number / 20
            if silent[0] <= second < silent[1] or (slow and list_id == 8 and number % 20):
                continue
            if list_id == 8 and stopped_before_s is not None and second >= stopped_before_s:
                continue
            counter = number // 20 if slow and list_id == 8 else number
            frames.append(
                telegram(b"\0", 1, subindex=0, counter=counter + 1, ts_ns=at_ns + list_id * MS, list_id=list_id)
            )
    batch = replace(batch_of(frames), until_ns=START_NS + int(until_s * SECOND_NS))
    source = Batches([batch, PacketBatch.nothing(START_NS + int(until_s * SECOND_NS))])
    source.infos = [replace(ETH0, path=f"eth{place}", without_carrier=tuple(own)) for place, own in enumerate(without)]
    witness = Witness()
    state = TrackerState(listeners=(witness,))
    for _ in run(source, Reading(), [state, witness]):  # type: ignore[arg-type]
        pass
    found = snapshot(state, source, Project(), overdue=True, witness=witness)  # type: ignore[arg-type]
    assert found.happened is not None
    return list(found.happened.causes)


def at(second: float) -> int:
    return START_NS + int(second * SECOND_NS)


def test_a_node_that_could_not_be_seen_is_not_silent() -> None:
    (one,) = causes((10, 20), [[(at(10), None)]])
    assert one.kind.name == "capture-incomplete"
    assert one.title == "Nothing could be captured since 10.0 s: eth0 has no carrier"
    assert one.until_ns is None
    assert [key.identifier for key in one.lists] == [7, 8]


def test_what_is_missing_when_the_cable_is_back_was_not_lost() -> None:
    (one,) = causes((10, 13), [[(at(10.1), at(13))]])
    assert one.title == "Nothing could be captured from 10.1 s to 13.0 s: eth0 had no carrier"
    assert (one.kind.name, one.until_ns) == ("capture-incomplete", at(13))


def test_without_a_word_of_the_interface_the_node_was_away() -> None:
    kinds = {one.kind.name for one in causes((10, 20), [[]])}
    assert kinds == {"node-silent"}


def test_what_stopped_long_before_did_not_stop_by_that() -> None:
    found = {one.kind.name: one for one in causes((15, 20), [[(at(15), None)]], stopped_before_s=5)}
    assert set(found) == {"capture-incomplete", "list-stopped"}
    assert [key.identifier for key in found["list-stopped"].lists] == [8]


def test_another_interface_that_went_on_could_have_seen_it() -> None:
    kinds = {one.kind.name for one in causes((10, 20), [[(at(10), None)], []])}
    assert "node-silent" in kinds


def test_two_interfaces_without_a_cable_at_once_saw_nothing() -> None:
    titles = [one.title for one in causes((10, 13), [[(at(9.9), at(13.1))], [(at(10), at(13))]])]
    assert titles == ["Nothing could be captured from 10.0 s to 13.0 s: eth0 and eth1 had no carrier"]


def test_a_cable_that_was_out_while_nothing_was_missing_is_a_note() -> None:
    (one,) = causes((99, 99), [[(at(5), at(5.02))]])
    assert (one.kind.name, one.severity.word) == ("capture-incomplete", "note")


def test_a_slow_list_that_is_not_due_yet_behind_that_has_not_stopped() -> None:
    """Its last telegram came a while before the cable was out, and its next one is due after the end."""
    found = causes((10.05, 21.2), [[(at(10.9), at(21.2))]], until_s=21.9, slow=True)
    assert {one.kind.name for one in found if one.severity.word != "note"} == {"capture-incomplete"}
