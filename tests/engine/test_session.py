"""A session: snapshots change nothing (law 1), its end is the report (law 6), and waits end although nothing comes."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.analysis.snapshot import Snapshot, snapshot
from nvscope.definition.project import Project
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.engine.session import Session
from nvscope.errors import UsageError
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests.laws import examples
from tests.oracle.builders import LINKS, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.traffic import generate
from tests.packets import Batches, batch_of, cut, document_of, observed, tracked
from tests.records import replace

S = 1_000_000_000
A, B, ALL = "10.0.0.1", "10.0.0.2", "255.255.255.255"


def shown(looked: Snapshot) -> dict[str, Any]:
    return report_document(looked.summary, looked.findings, [])


def pause(until_ns: int) -> PacketBatch:
    """Return a batch that says that nothing came until then."""
    return replace(batch_of([]), until_ns=until_ns)


def codes(state: TrackerState, **options: Any) -> dict[str, int]:
    looked = snapshot(state, Batches([]), Project(), **options)
    return {finding.code: finding.count for finding in looked.findings}


@examples(50)
@given(st.integers(0, 10_000), st.integers(1, 90))
def test_snapshots_change_nothing(seed: int, packets: int) -> None:
    whole = batch_of(generate(seed, frames=200, link=LINKS[seed % len(LINKS)]))
    state = TrackerState()
    for _ in run(Batches(cut(whole, packets)), Reading(), [state]):
        shown(snapshot(state, Batches([]), Project(), overdue=True))
    assert document_of(state) == document_of(tracked([whole]))


@examples()
@given(st.integers(0, 10_000), st.integers(1, 90))
def test_a_session_ends_with_the_report_on_its_packets(seed: int, packets: int) -> None:
    whole = batch_of(generate(seed, frames=200, link=1))
    state = TrackerState()
    source = Batches(cut(whole, packets))
    session = Session(source, Reading(), [state], lambda: snapshot(state, source, Project()))
    session.start()
    assert session.wait(30)
    assert shown(session.snapshot()) == shown(session.stop()) == document_of(tracked([whole]))


class Steered:
    """A source that gives a batch when it is told to, until it is stopped."""

    def __init__(self, batches: list[PacketBatch]) -> None:
        self.infos: list[Any] = []
        self.channels: list[str] = []
        self._batches, self.left = batches, len(batches)
        self._turns, self._taken = threading.Semaphore(0), threading.Semaphore(0)
        self._stopped = False

    def go_on(self) -> None:
        """Give a batch, and come back when it was asked for: all before it have been told."""
        self._turns.release()
        assert self._taken.acquire(timeout=30)

    def stop(self) -> None:
        self._stopped = True
        self._turns.release()

    def __iter__(self) -> Iterator[PacketBatch]:
        for batch in self._batches:
            self._turns.acquire()
            self.left -= 1
            if self._stopped:
                return
            self._taken.release()
            yield batch


def frames_from(begin: int, count: int) -> list[Frame]:
    return [
        data_frame(number * S // 10, A, ALL, telegram(counter=number, list_id=7, data=bytes(4)))
        for number in range(begin, begin + count)
    ]


def test_a_running_session_is_looked_at_between_its_batches_and_stopped() -> None:
    pauses = [pause(S + number) for number in range(10_000)]
    state, source = TrackerState(), Steered([batch_of(frames_from(1, 10)), *pauses])
    session = Session(source, Reading(), [state], lambda: state.capture.summary(0))
    session.start()
    seen = session.snapshot(patience_s=5)
    assert (seen.frames, seen.until_ns) == (0, None)
    while not seen.frames:
        source.go_on()
        seen = session.snapshot(patience_s=5)
    assert (seen.frames, seen.end_ns, session.ended) == (10, S, False)
    last = session.stop()
    assert session.ended
    assert (last.frames, state.capture.until_ns) == (10, last.until_ns)
    with pytest.raises(AttributeError):
        last.frames = 3  # type: ignore[misc]  # a snapshot is a value


def test_a_session_is_looked_at_while_its_source_pauses_and_says_nothing() -> None:
    state, source = TrackerState(), Steered([batch_of(frames_from(1, 10)), batch_of(frames_from(11, 3))])
    session = Session(source, Reading(), [state], lambda: (state.capture.summary(0), threading.current_thread()))
    session.start()
    source.go_on()
    by_deadline = time.monotonic() + 30
    seen, _ = session.snapshot()
    while not seen.frames and time.monotonic() < by_deadline:
        seen, _ = session.snapshot()
    assert seen.frames == 10
    last, made_in = session.stop()
    assert last.frames == 10
    assert made_in is not threading.current_thread()


@examples()
@given(st.lists(st.integers(1, 30), min_size=1, max_size=40), st.integers(1, 4))
def test_no_look_sees_a_batch_that_is_half_told(sizes: list[int], askers: int) -> None:
    """Whoever asks, and whenever: what one observer has seen, the others have."""
    batches, begin = [], 1
    for size in sizes:
        batches.append(batch_of(frames_from(begin, size)))
        begin += size
    states = TrackerState(), TrackerState()
    ends = {sum(sizes[:told]) for told in range(len(sizes) + 1)}
    seen: list[tuple[int, int]] = []

    def look() -> tuple[int, int]:
        one, other = (state.capture.summary(0).frames for state in states)
        return one, other

    session = Session(Batches(batches), Reading(), states, look)

    def ask() -> None:
        while not session.ended:
            session._looked_at_s = -1e9  # as if the last look were long past
            seen.append(session.snapshot())

    session.start()
    threads = [threading.Thread(target=ask) for _ in range(askers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert session.stop() == (sum(sizes), sum(sizes))
    assert all(one == other and one in ends for one, other in seen)


def test_who_asks_at_once_and_does_not_wait_is_answered() -> None:
    for _ in range(20):
        state, source = TrackerState(), Steered([batch_of(frames_from(1, 10))])
        session = Session(source, Reading(), [state], lambda state=state: state.capture.summary(0))
        session.start()
        assert session.snapshot(patience_s=0).frames == 0
        session.stop()


def test_a_session_that_was_not_started_says_so_and_can_be_stopped() -> None:
    source = Steered([])
    session = Session(source, Reading(), [TrackerState()], lambda: "nothing yet")
    with pytest.raises(UsageError, match="not started"):
        session.snapshot(patience_s=0)
    assert not session.wait(0)
    assert session.stop() == "nothing yet"
    session.start()
    assert session.wait(30)
    with pytest.raises(UsageError, match="started once"):
        session.start()


def test_what_a_source_or_an_observer_raises_reaches_who_asks() -> None:
    def broken() -> Iterator[PacketBatch]:
        yield batch_of(frames_from(1, 3))
        raise ValueError("the cable burns")

    session = Session(Batches(broken()), Reading(), [TrackerState()], lambda: None)
    session.start()
    assert session.wait(30)
    for ask in (session.snapshot, session.stop):
        with pytest.raises(ValueError, match="the cable burns"):
            ask()


def test_snapshots_of_a_session_can_be_subtracted() -> None:
    """The figures of a look stay as they were, and what came since is the rest."""
    pauses = [pause(S + number) for number in range(1_000)]
    batches = [batch_of(frames_from(1, 10)), *pauses, batch_of(frames_from(11, 3))]
    state, source = TrackerState(), Steered(batches)
    session = Session(source, Reading(), [state], lambda: snapshot(state, source, Project(), figures=True))
    session.start()
    first = session.snapshot(patience_s=5)
    while not first.summary.capture.frames:
        source.go_on()
        first = session.snapshot(patience_s=5)
    while source.left:
        source.go_on()
    assert session.wait(30)
    last = session.stop()
    assert first.figures is not None
    assert last.figures is not None
    both = first.figures.summary(), (last.figures - first.figures).summary()
    assert [summary.lists[0].diagnosis.nSendCount for summary in both] == [10, 3]
    assert both[0].capture == first.summary.capture
    in_one_go = tracked(batches)
    told = shown(last)
    assert told["capture"]["until_ns"] == str(in_one_go.capture.summary(0).at_ns)
    told["capture"]["until_ns"] = None
    assert told == document_of(in_one_go)
    assert snapshot(state, source, Project()).figures is None


# --- time passes, and nothing comes


def waiting() -> list[Frame]:
    """A telegram that wants an acknowledgement, and a request for another list, at 1 s and 1.2 s."""
    return [
        data_frame(S, A, B, telegram(counter=1, list_id=7, flags=1, data=bytes(4))),
        data_frame(S * 12 // 10, B, ALL, telegram(6, list_id=8, data=b"")),
    ]


@pytest.mark.parametrize(
    ("until_ns", "expected"),
    [
        (2 * S, {}),
        (2 * S + 1, {"NV301": 1}),
        (S * 22 // 10, {"NV301": 1}),
        (3 * S, {"NV301": 1, "NV304": 1}),
    ],
)
def test_waits_end_although_no_frame_shows_it(until_ns: int, expected: dict[str, int]) -> None:
    state = observed(TrackerState(), [batch_of(waiting()), pause(until_ns)])
    assert codes(state) == expected
    lists = {entry.key.identifier: entry for entry in summarize(state).lists}
    assert lists[7].counters["missing_acknowledgements"] == expected.get("NV301", 0)
    assert lists[8].counters["bootup_unanswered"] == expected.get("NV304", 0)
    assert lists[7].diagnosis.tLastError == (2 * S if "NV301" in expected else None)
    assert lists[8].diagnosis.sLastError == ("UDPANSWERBOOTUPREQUEST" if "NV304" in expected else "NOERROR")


def test_a_wait_that_time_has_ended_is_not_ended_again_by_a_frame() -> None:
    late = data_frame(9 * S, A, B, telegram(counter=2, list_id=7, data=bytes(4)))
    by_time = observed(TrackerState(), [batch_of(waiting()), pause(5 * S), batch_of([late])])
    by_frame = tracked([batch_of([*waiting(), late])])
    assert document_of(by_time) == document_of(by_frame)


def test_what_is_overdue_counts_where_a_time_is_given_and_nothing_changes() -> None:
    state = tracked([batch_of(waiting())])
    before = document_of(state)
    assert codes(state) == codes(state, overdue=True) == {}
    assert document_of(state) == before
    state.capture.until_ns = 4 * S  # as if a source had said so to the capture alone
    before = document_of(state)
    assert codes(state) == {}
    assert codes(state, overdue=True) == {"NV301": 1, "NV304": 1}
    assert document_of(state) == before


def test_a_list_that_falls_silent_is_told_while_nothing_comes() -> None:
    frames = frames_from(1, 30)
    assert codes(observed(TrackerState(), [batch_of(frames), pause(3 * S + S // 2)])) == {}
    assert codes(observed(TrackerState(), [batch_of(frames), pause(9 * S)])) == {"NV504": 1}
