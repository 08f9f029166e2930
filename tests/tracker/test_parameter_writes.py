"""Who wrote which value over which, and what became of it: what is kept, and what is left out."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.reading import Reading
from nvscope.findings.judge import judge
from nvscope.tracker.parameter.writes import Outcome, Write
from nvscope.tracker.state import TrackerState
from tests.laws import every_other, examples
from tests.oracle.builders import MILLISECOND, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.parameter_traffic import parameter_traffic
from tests.packets import batch_of, cut, recorded, tracked
from tests.tracker.test_parameter import told as told_of_requests

HMI, SERVICE, PRESS = "10.0.0.1", "10.0.0.3", "10.0.0.2"
READ, READ_REPLY, WRITE, WRITE_REPLY, REFUSED, TIME_OUT, BUSY = 1, 2, 3, 4, 22, 27, 100

Step = tuple[int, int, int, bytes]

KNOWN: list[Step] = [(0, READ, 1, b""), (1, READ_REPLY, 1, b"4")]
WRITTEN: list[Step] = [(0, WRITE, 1, b"5"), (1, WRITE_REPLY, 1, b"")]


def exchange(*steps: Step, hmi: str = HMI, port: int = 1202) -> list[Frame]:
    """Return telegrams about one parameter: when in ms, the service, Counter, and the value."""
    return [
        data_frame(
            at_ms * MILLISECOND, *((hmi, PRESS) if service in (READ, WRITE) else (PRESS, hmi)),
            telegram(service, 0x2000, 1, counter=counter, data=data), port=port, source_port=port,
        )
        for at_ms, service, counter, data in steps
    ]  # fmt: skip


def writes(state: TrackerState) -> list[Write]:
    known = state.parameters.known
    assert known is not None
    return known.writes.kept


def told(frames: list[Frame]) -> list[tuple[bytes | None, bytes, Outcome]]:
    """Return old value, new value and outcome of each write, the same however the capture is cut."""
    found = [writes(tracked(cut(batch_of(frames), size))) for size in every_other(1, 2, 3, len(frames))]
    assert found == [found[0]] * len(found)
    return [(one.old and one.old.data, one.new.data, one.outcome) for one in found[0]]


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ([(0, WRITE, 1, b"5"), (1, WRITE_REPLY, 1, b"")], [(None, b"5", "confirmed")]),
        ([(0, READ, 1, b""), (1, READ_REPLY, 1, b"4"), (2, WRITE, 2, b"5"), (3, WRITE_REPLY, 2, b"")],
         [(b"4", b"5", "confirmed")]),
        ([(0, WRITE, 1, b"5"), (1, WRITE_REPLY, 1, b""), (2, WRITE, 2, b"6")],
         [(None, b"5", "confirmed"), (b"5", b"6", "open")]),
        # What is refused, or answered by busy, changes nothing of what is known; what nobody answers may be written.
        ([(0, READ, 1, b""), (1, READ_REPLY, 1, b"4"), (2, WRITE, 2, b"5"), (3, REFUSED, 2, b""), (4, WRITE, 3, b"6"),
          (5, BUSY, 3, b""), (6, WRITE, 4, b"7"), (600, WRITE, 5, b"8")],
         [(b"4", b"5", "refused"), (b"4", b"6", "busy"), (b"4", b"7", "unanswered"), (None, b"8", "open")]),
        ([*KNOWN, (2, WRITE, 2, b"5"), (3, TIME_OUT, 2, b""), (4, WRITE, 3, b"6")],
         [(b"4", b"5", "refused"), (None, b"6", "open")]),
        ([*KNOWN, (2, WRITE, 2, b"5"), (600, READ, 3, b""), (601, READ_REPLY, 3, b"4"), (602, WRITE, 4, b"6")],
         [(b"4", b"5", "unanswered"), (b"4", b"6", "open")]),
        # Nobody knows, either, what a write leaves that is open, or was together with another one.
        ([*KNOWN, (2, WRITE, 2, b"5"), (3, WRITE, 3, b"6"), (4, WRITE_REPLY, 3, b""), (5, WRITE_REPLY, 2, b""),
          (6, WRITE, 4, b"7")], [(b"4", b"5", "confirmed"), (None, b"6", "confirmed"), (None, b"7", "open")]),
        # A reply to a read tells what is there, also a late one, or one whose request nobody saw.
        ([(0, READ_REPLY, 1, b"4"), (2, WRITE, 2, b"5")], [(b"4", b"5", "open")]),
        ([*KNOWN, (2, READ, 2, b""), (600, READ_REPLY, 2, b"7"), (602, WRITE, 3, b"5")], [(b"7", b"5", "open")]),
        ([*KNOWN, (2, READ, 2, b""), (600, WRITE, 3, b"5"), (601, WRITE_REPLY, 3, b""), (602, READ_REPLY, 2, b"4"),
          (603, WRITE, 4, b"6")], [(b"4", b"5", "confirmed"), (None, b"6", "open")]),
        ([*WRITTEN, (600, READ, 2, b""), (1200, READ_REPLY, 2, b"7"), (1201, WRITE, 3, b"6")],
         [(None, b"5", "confirmed"), (b"7", b"6", "open")]),
        # But not if something was written since it was asked for.
        ([*KNOWN, (2, READ, 2, b""), (3, WRITE, 3, b"5"), (4, WRITE_REPLY, 3, b""), (5, READ_REPLY, 2, b"9"),
          (6, WRITE, 4, b"6")], [(b"4", b"5", "confirmed"), (None, b"6", "open")]),
        # What comes again tells nothing new.
        ([*WRITTEN, (2, WRITE_REPLY, 1, b""), (3, WRITE, 2, b"6")], [(None, b"5", "confirmed"), (b"5", b"6", "open")]),
        ([*WRITTEN, (2, READ, 2, b""), (3, READ_REPLY, 2, b"7"), (4, READ_REPLY, 2, b"7"), (5, WRITE, 3, b"6")],
         [(None, b"5", "confirmed"), (b"7", b"6", "open")]),
        # A late confirmation confirms what was asked for last; any other one is of something nobody saw.
        ([*KNOWN, (2, WRITE, 2, b"5"), (600, WRITE_REPLY, 2, b""), (601, WRITE, 3, b"6")],
         [(b"4", b"5", "unanswered"), (b"5", b"6", "open")]),
        ([*KNOWN, (2, WRITE, 2, b"5"), (3, BUSY, 2, b""), (4, WRITE_REPLY, 2, b""), (5, WRITE, 3, b"6")],
         [(b"4", b"5", "busy"), (b"5", b"6", "open")]),
        ([*KNOWN, (2, WRITE, 2, b"5"), (3, REFUSED, 2, b""), (4, WRITE_REPLY, 2, b""), (5, WRITE, 3, b"6")],
         [(b"4", b"5", "refused"), (None, b"6", "open")]),
        ([*KNOWN, (2, WRITE, 2, b"5"), (600, WRITE, 3, b"6"), (601, WRITE_REPLY, 2, b""), (602, WRITE_REPLY, 3, b""),
          (603, WRITE, 4, b"7")], [(b"4", b"5", "unanswered"), (None, b"6", "confirmed"), (None, b"7", "open")]),
        ([*KNOWN, (2, WRITE_REPLY, 9, b""), (3, WRITE, 2, b"5")], [(None, b"5", "open")]),
        ([*KNOWN, (2, WRITE, 2, b"5"), (600, WRITE, 2, b"6"), (601, WRITE_REPLY, 2, b""), (602, WRITE, 3, b"7")],
         [(b"4", b"5", "unanswered"), (None, b"6", "confirmed"), (None, b"7", "open")]),
        # What is repeated is one write.
        ([(0, WRITE, 1, b"5"), (100, WRITE, 1, b"5"), (101, WRITE_REPLY, 1, b""), (200, WRITE, 2, b"7")],
         [(None, b"5", "confirmed"), (b"5", b"7", "open")]),
        # Another value is another write: nobody knows which of them the reply is about.
        ([(0, WRITE, 1, b"5"), (100, WRITE, 1, b"6"), (101, WRITE_REPLY, 1, b""), (200, WRITE, 2, b"7")],
         [(None, b"5", "open"), (None, b"6", "open"), (None, b"7", "open")]),
        # What was known when it was asked for counts, not what is read meanwhile.
        ([(0, READ, 1, b""), (1, READ_REPLY, 1, b"4"), (2, WRITE, 2, b"5"), (3, READ, 3, b""), (4, READ_REPLY, 3, b"5"),
          (5, WRITE_REPLY, 2, b"")], [(b"4", b"5", "confirmed")]),
    ],
)  # fmt: skip
def test_a_write_over_a_value(steps: list[Step], expected: list[tuple[bytes | None, bytes, str]]) -> None:
    assert told(exchange(*steps)) == expected


def test_a_value_is_known_whoever_asked_for_it_and_on_whichever_port() -> None:
    frames = [
        *exchange((0, READ, 1, b""), (1, READ_REPLY, 1, b"4"), hmi=SERVICE, port=1203),
        *exchange((2, WRITE, 1, b"5"), (3, REFUSED, 1, b"")),
    ]
    (one,) = writes(tracked([batch_of(frames)]))
    assert one.old is not None
    assert (one.old.data, one.requester, one.partner, one.port) == (b"4", HMI, PRESS, 1202)
    assert (one.index, one.subindex) == (0x2000, 1)
    assert (one.error, one.frame, one.answer_frame, one.time_ns) == ("ODErrorReplyAccess", 3, 4, 2 * MILLISECOND)


def test_of_a_long_value_the_beginning_is_kept_and_its_size() -> None:
    long = bytes(range(200)) + bytes(200)
    frames = exchange((0, WRITE, 1, long), (1, WRITE_REPLY, 1, b""), (2, WRITE, 2, b"5"))
    first, second = writes(tracked([batch_of(frames)]))
    assert (first.new.data, first.new.size_bytes, first.new.is_cut) == (long[:256], 400, True)
    assert second.old == first.new
    assert not second.new.is_cut


def test_a_value_that_was_not_captured_whole_is_not_known_and_what_was_known_before_is_not_either() -> None:
    frames = exchange(
        (0, READ, 1, b""), (1, READ_REPLY, 1, b"1234"), (2, READ, 2, b""), (3, READ_REPLY, 2, b"5678"),
        (4, WRITE, 3, b"9999"), (5, WRITE_REPLY, 3, b""), (6, WRITE, 4, b"0000"),
    )  # fmt: skip
    frames[3] = frames[3]._replace(data=frames[3].data[:-1])
    frames[4] = frames[4]._replace(data=frames[4].data[:-2])
    assert told(frames) == [(None, b"99", "confirmed"), (None, b"0000", "open")]


def test_where_answers_are_not_to_be_seen_nobody_knows_what_became_of_a_write() -> None:
    frames = exchange(
        (0, READ, 1, b""), (1, READ_REPLY, 1, b"4"), (2, WRITE, 2, b"5"), (3, WRITE_REPLY, 2, b""),
        (900, WRITE, 2, b"6"),
    )  # fmt: skip
    for size in (1, 2, 5):
        found = writes(tracked(cut(batch_of(frames), size), Reading(hears_answers=False)))
        assert [(one.old, one.new.data, one.outcome) for one in found] == [(None, b"5", "open"), (None, b"6", "open")]


def test_a_malformed_write_may_have_been_taken() -> None:
    frames = exchange(*KNOWN, (3, WRITE, 3, b"6"))
    malformed = telegram(WRITE, 0x2000, 1, counter=2, data=b"5", length=99)
    frames.insert(2, data_frame(2 * MILLISECOND, HMI, PRESS, malformed))
    assert told(frames) == [(None, b"6", "open")]


def test_what_was_open_when_nobody_listened_any_more_stays_open() -> None:
    first, second = exchange((0, WRITE, 1, b"5")), exchange((400, WRITE_REPLY, 1, b""), (900, WRITE, 2, b"6"))
    state = tracked(recorded([batch_of(first)], [batch_of(second)]))
    assert [(one.old, one.outcome) for one in writes(state)] == [(None, "open"), (None, "open")]


def limits_told(state: TrackerState) -> list[str]:
    return [one.message.partition("Left out: ")[2] for one in judge(state) if one.code == "NV906"]


@pytest.mark.parametrize("size", [1, 3, 100])
def test_writes_beyond_the_limit_are_told(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr("nvscope.tracker.parameter.writes.MOST_WRITES", 2)
    steps = [(at, service, at // 2, bytes([at])) for at, service in enumerate([WRITE, WRITE_REPLY] * 5)]
    state = tracked(cut(batch_of(exchange(*steps)), size))
    assert [(one.new.data, one.outcome) for one in writes(state)] == [(b"\0", "confirmed"), (b"\2", "confirmed")]
    assert limits_told(state) == ["3 Parameter Manager writes beyond the 2 that are kept."]


@pytest.mark.parametrize("size", [1, 3, 100])
def test_values_beyond_the_limit_are_told(size: int) -> None:
    frames = [
        data_frame((at + 4 * index) * MILLISECOND, *ends, telegram(service, 0x2000 + index, data=bytes(2)))
        for index in range(3)
        for at, (service, *ends) in enumerate([(READ, HMI, PRESS), (READ_REPLY, PRESS, HMI), (WRITE, HMI, PRESS)])
    ]
    state = tracked(cut(batch_of(frames), size), Reading(max_streams=2))
    assert [one.old is None for one in writes(state)] == [False, False, True]
    assert limits_told(state) == ["1 value of further parameters."]


@examples(60)
@given(
    seed=st.integers(0, 10_000), packets=st.integers(1, 60), most=st.integers(0, 30), streams=st.integers(2, 20)
)  # fmt: skip
def test_any_cut_leaves_out_the_same(seed: int, packets: int, most: int, streams: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("nvscope.tracker.parameter.writes.MOST_WRITES", most)
        whole, reading = batch_of(parameter_traffic(seed)), Reading(max_streams=streams)
        at_once, in_parts = tracked([whole], reading), tracked(cut(whole, packets), reading)
        assert (writes(in_parts), limits_told(in_parts)) == (writes(at_once), limits_told(at_once))
        assert told_of_requests(in_parts) == told_of_requests(at_once)
        assert len(writes(at_once)) <= most
