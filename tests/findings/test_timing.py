"""NV501 to NV504 against the interval and the MinGap of a definition, and against limits that are set."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition.limits import Limits
from nvscope.definition.model import Definition
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.tracker.summary import Summary, summarize
from nvscope.view.documents.report import report_document
from tests.definition.lists import BOOL, list_of, telegram
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import batch_of, tracked
from tests.records import replace

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000
LIST = list_of([BOOL])


def sent(intervals_ms: Iterable[float], *, step: int = 1, list_id: int = 7) -> list[Frame]:
    """Return telegrams with these intervals in between, whose counters are ``step`` apart."""
    times = accumulate((round(interval * MS) for interval in intervals_ms), initial=START_NS)
    return [
        telegram(b"\0", 1, subindex=0, counter=step * number, ts_ns=ts_ns, list_id=list_id)
        for number, ts_ns in enumerate(times)
    ]


def defined(interval_ms: int | None = None, min_gap_ms: int | None = None, *, cyclic: bool = True) -> Definition:
    """Return the definition of the list, sent at an interval, with a least gap."""
    interval_ns, min_gap_ns = (None if ms is None else ms * MS for ms in (interval_ms, min_gap_ms))
    return Definition((replace(LIST, interval_ns=interval_ns, min_gap_ns=min_gap_ns, cyclic=cyclic),))


def judged(
    frames: list[Frame], definition: Definition | None = None, limits: Limits | None = None
) -> dict[str, Finding]:
    """Return the findings on timing by code."""
    found = judge(tracked([batch_of(frames)]), definition=definition, limits=limits)
    return {finding.code: finding for finding in found if finding.code.startswith("NV5")}


def nominal(frames: list[Frame], definition: Definition) -> int | None:
    """Return the nominal interval that the report of the stream has."""
    state = tracked([batch_of(frames)])
    summary: Summary = summarize(state, intervals_ns=definition.nominal_intervals_ns())
    document = report_document(summary, [], [], definition)
    told: int | None = document["lists"][0]["streams"][0]["interval_ns"]["nominal"]
    return told


def test_a_list_that_is_sent_at_its_interval_is_no_finding() -> None:
    frames = sent([50, 50.5, 49.5] * 30)
    assert judged(frames, defined(50, 20)) == {}
    assert nominal(frames, defined(50)) == 50 * MS


def test_a_list_that_is_always_sent_too_slowly_is_always_late() -> None:
    frames = sent([500] * 99)
    found = judged(frames, defined(50))
    assert set(found) == {"NV501"}
    late = found["NV501"]
    assert late.message == (
        "99 intervals longer than 125.0 ms without a loss; nominal is 50.0 ms by the definition, "
        "the longest was 500.0 ms. It is sent every 500.0 ms: another definition or setting runs in the sender."
    )
    assert late.hint.startswith("Compare interval, MinGap and the cycle of the task in the sender's project")
    assert (late.count, late.first_ns, late.last_ns) == (99, frames[0].ts_ns, frames[-1].ts_ns)
    assert late.frames == tuple(range(2, 12))
    assert nominal(frames, defined(50)) == 50 * MS
    assert judged(frames) == {}  # by itself it is regular


def test_late_ones_among_others_are_named_by_their_frames() -> None:
    late = judged(sent([50] * 20 + [200] + [50] * 20 + [126] + [50] * 5), defined(50))["NV501"]
    assert (late.count, late.frames) == (2, (22, 43))
    assert (late.first_ns, late.last_ns) == (START_NS + 1200 * MS, START_NS + 2326 * MS)


def test_an_interval_at_the_limit_is_not_late() -> None:
    assert judged(sent([50] * 80 + [125] + [50] * 80), defined(50)) == {}


def test_a_list_that_is_always_sent_too_fast_is_a_burst() -> None:
    found = judged(sent([20] * 99), defined(500))
    assert set(found) == {"NV503"}
    assert found["NV503"].count == 99
    assert found["NV503"].message == (
        "99 intervals shorter than 50.0 ms; nominal is 500.0 ms by the definition, the shortest was 20.0 ms. "
        "It is sent every 20.0 ms: another definition or setting runs in the sender."
    )
    assert found["NV503"].frames == tuple(range(2, 12))


@pytest.mark.parametrize(("on_change", "on_event"), [(True, False), (False, True)])
def test_what_is_sent_on_change_too_may_be_sent_more_often_than_its_interval(on_change: bool, on_event: bool) -> None:
    (entry,) = defined(500).lists
    definition = Definition((replace(entry, on_change=on_change, on_event=on_event),))
    burst = judged(sent([20] * 99), definition)["NV503"]
    assert burst.message.endswith("the shortest was 20.0 ms.")
    assert burst.hint == ""


def test_a_few_late_ones_are_the_sender_being_late() -> None:
    late = judged(sent([50] * 20 + [200] * 9), defined(50))["NV501"]
    assert late.message.endswith("the longest was 200.0 ms.")
    assert late.hint == ""


@pytest.mark.parametrize("cut", [1, 5, 9, 14, 30])
def test_frames_of_usual_intervals_are_the_first_ten_however_they_came(cut: int) -> None:
    """The first late one is the third interval; from then on the stream's own usual interval is late."""
    frames = sent([50, 50] + [500] * 60)
    state = tracked([batch_of(frames[:cut]), batch_of(frames[cut:])])
    (late,) = (finding for finding in judge(state, definition=defined(50)) if finding.code == "NV501")
    assert (late.count, late.frames) == (60, tuple(range(4, 14)))


def test_half_of_the_intervals_beyond_the_limit() -> None:
    slow = [110, 140] * 60  # all of them near the usual interval: 125 ms is the limit
    late = judged(sent(slow), defined(50))["NV501"]
    assert late.count == 60
    # Known are those of the first eighteen intervals: while the usual one was learned, and ten more.
    assert late.frames == tuple(range(3, 20, 2))


@pytest.mark.parametrize("cyclic", [True, False])
def test_intervals_below_the_least_gap(cyclic: bool) -> None:
    burst = judged(sent([50] * 20 + [15, 35] + [50] * 20 + [5] + [50] * 9), defined(50, 20, cyclic=cyclic))["NV503"]
    assert (burst.count, burst.frames) == (2, (22, 44))
    assert burst.message == ("2 intervals shorter than the MinGap of the definition, 20.0 ms; the shortest was 5.0 ms.")


def test_the_least_gap_of_a_list_that_is_sent_as_fast_as_it_may() -> None:
    assert judged(sent([20] * 99), defined(min_gap_ms=20)) == {}
    burst = judged(sent([19] * 99), defined(min_gap_ms=20))["NV503"]
    assert burst.count == 99
    assert burst.message.endswith(
        "The sender does not keep the MinGap of the definition, its median interval is 19.0 ms."
    )


def test_the_least_gap_without_any_regularity() -> None:
    frames = sent([3000, 10, 700, 5, 90, 4000, 60, 1] * 4)
    burst = judged(frames, defined(min_gap_ms=20, cyclic=False))["NV503"]
    assert burst.count == 12
    assert judged(frames, defined(cyclic=False)) == {}


def test_intervals_with_a_loss_are_not_late() -> None:
    assert "NV501" not in judged(sent([250] * 99, step=5), defined(50))
    mixed = sent([250] * 40, step=5)
    behind = sent([250] * 60)
    for number, frame in enumerate(behind[1:], 1):
        mixed.append(
            telegram(b"\0", 1, subindex=0, counter=200 + number, ts_ns=mixed[40].ts_ns + frame.ts_ns - START_NS)
        )
    late = judged(mixed, defined(50))["NV501"]
    assert late.count == 60
    assert late.message.startswith("At least 60 intervals longer than 125.0 ms without a loss")


def test_a_list_that_is_not_sent_cyclically_has_no_interval_whatever_it_shows() -> None:
    # Sent at 500 ms by chance, then late, in a burst, and no more: nothing of that was promised.
    frames = [*sent([500] * 50 + [5000] + [500] * 10 + [1]), *sent([100] * 900, list_id=8)]
    frames.sort(key=lambda frame: frame.ts_ns)
    shown = nominal(frames, Definition())
    assert shown is not None
    assert abs(shown - 500 * MS) <= 5 * MS
    assert set(judged(frames)) == {"NV501", "NV502", "NV503", "NV504"}
    for interval_ms in (50, 500, None):
        told = defined(interval_ms, cyclic=False)
        assert nominal(frames, told) is None
        assert judged(frames, told) == {}


def test_a_list_of_which_only_the_variables_are_defined_has_the_interval_that_it_shows() -> None:
    observed = nominal(sent([500] * 50), defined())
    assert observed is not None
    assert abs(observed - 500 * MS) <= 5 * MS


def test_one_telegram_and_silence() -> None:
    other = sent([100] * 10, list_id=8)
    definition = Definition((*defined(50).lists, replace(LIST, list_id=8)))
    stopped = judged([*sent([]), *other], definition)["NV504"]
    assert (stopped.list_number, stopped.frames) == (0, (1,))
    assert stopped.message == "Silent for the last 1.0 s; nominal is 50.0 ms by the definition."
    assert judged([*sent([]), *other]) == {}


def test_jitter_is_a_share_of_the_defined_interval() -> None:
    frames = sent([40, 60] * 40)
    assert "NV502" not in judged(frames, defined(50))
    assert "NV502" in judged(frames, defined(20), Limits(late_percent=1000))


def test_limits_that_are_set() -> None:
    frames = sent([50] * 200 + [120] + [50] * 100 + [15, 50])
    assert judged(frames, defined(50)) == {}
    assert judged(frames, defined(50), Limits(late_percent=230))["NV501"].count == 1
    assert judged(frames, defined(50), Limits(burst_percent=40))["NV503"].count == 1
    uneven = sent([40, 70] * 40)
    assert "NV502" in judged(uneven, defined(50))
    assert "NV502" not in judged(uneven, defined(50), Limits(jitter_percent=70))
    quiet = [*frames, *sent([60_000], list_id=8)[1:]]
    assert "NV504" in judged(quiet, defined(50))
    assert "NV504" not in judged(quiet, defined(50), Limits(stopped_percent=1_000_000))


@examples(60)
@given(
    usual_ms=st.integers(5, 400),
    interval_ms=st.integers(2, 1000),
    factors=st.lists(st.floats(0.05, 4), min_size=1, max_size=60),
)
def test_counts_differ_from_exact_ones_only_near_the_limit(
    usual_ms: int, interval_ms: int, factors: list[float]
) -> None:
    """Intervals are kept in buckets of 0.8 %: none within the limit counts, and none well beyond it is left out."""
    intervals_ms = [usual_ms * factor for factor in [1.0] * 8 + factors]
    exact_ns = [round(interval * MS) for interval in intervals_ms]
    found = judged(sent(intervals_ms), defined(interval_ms))
    late, burst = (found[code].count if code in found else 0 for code in ("NV501", "NV503"))
    longest_ns, shortest_ns = interval_ms * MS * 250 // 100, interval_ms * MS * 10 // 100
    assert sum(ns > longest_ns * 1.008 for ns in exact_ns) <= late <= sum(ns > longest_ns for ns in exact_ns)
    assert sum(ns < shortest_ns * 0.992 for ns in exact_ns) <= burst <= sum(ns < shortest_ns for ns in exact_ns)


@pytest.mark.parametrize(
    ("back_ns", "steps"), [(0, 0), (797, 0), (MS - 1, 0), (MS, 0), (MS + 1, 1), (3_600_000 * MS, 1)]
)
def test_a_clock_steps_where_it_goes_back_by_more_than_1_ms(back_ns: int, steps: int) -> None:
    frames = sent([50] * 20)
    frames[10] = frames[10]._replace(ts_ns=frames[9].ts_ns - back_ns)
    for cut in (21, 10):
        found = judge(tracked([batch_of(frames[:cut]), batch_of(frames[cut:])]))
        told = [finding for finding in found if finding.code == "NV902"]
        assert [(finding.count, finding.frames) for finding in told] == [(1, (11,))] * steps


@pytest.mark.parametrize("intervals", range(1, 8))
def test_few_intervals_are_no_cycle(intervals: int) -> None:
    frames = sent([100] * intervals)
    silent = [*frames, *(frame._replace(ts_ns=frame.ts_ns + 60_000 * MS) for frame in sent([100] * 3, list_id=8))]
    assert (nominal(silent, Definition()) is not None) == (intervals >= 5)
    assert set(judged(silent)) == ({"NV504"} if intervals >= 5 else set())
    assert set(judged(silent, defined(100))) >= {"NV504"}


def test_how_far_each_goes_is_told_in_figures() -> None:
    intervals = [50] * 20 + [300] + [50] * 20 + [1] + [50] * 20 + [200]
    other = sent([50] * 100, list_id=8)
    found = judged(sorted([*sent(intervals), *other], key=lambda frame: frame.ts_ns), defined(50))
    silent_ns = other[-1].ts_ns - START_NS - round(sum(intervals) * MS)
    assert {code: found[code].extent for code in ("NV501", "NV503", "NV504")} == {
        "NV501": 300 * MS, "NV503": MS, "NV504": silent_ns,
    }  # fmt: skip


def test_the_longest_interval_is_one_without_a_loss_and_the_shortest_is_none_of_a_clock_that_steps() -> None:
    frames = sent([50] * 20 + [200] + [50] * 20)
    later = [
        telegram(b"\0", 1, subindex=0, counter=number, ts_ns=frames[-1].ts_ns + ns)
        for number, ns in ((90, 2000 * MS), (91, 2050 * MS), (92, 2051 * MS), (93, 2000 * MS), (94, 2050 * MS))
    ]
    found = judged([*frames, *later], defined(50))
    late, burst = found["NV501"], found["NV503"]
    assert late.count == 1
    assert late.extent is not None
    assert late.extent == pytest.approx(200 * MS, rel=0.008)
    assert "the longest was 20" in late.message
    assert burst.extent == pytest.approx(MS, rel=0.008)


JITTERY = [number for number in range(260) if number not in {101, 141, 201}]
"""Counters of telegrams that come each 50 ms, without those that are missing."""


def counted(counters: Iterable[int], **fields: int) -> list[Frame]:
    return [
        telegram(b"\0", 1, subindex=0, counter=number, ts_ns=START_NS + number * 50 * MS, **fields)
        for number in counters
    ]


def test_jitter_that_comes_from_loss_says_so() -> None:
    jitter = judged(counted(JITTERY))["NV502"]
    assert "It comes from loss: where no telegram is missing, jitter is 0" in jitter.message
    assert "(NV201)" in jitter.hint


def test_jitter_that_comes_from_overtaken_telegrams_speaks_of_no_loss() -> None:
    frames = counted(JITTERY)
    for number in (101, 141, 201):
        late = telegram(b"\0", 1, subindex=0, counter=number, ts_ns=START_NS + (number + 1) * 50 * MS + MS)
        frames.append(late)
    found = judge(tracked([batch_of(sorted(frames, key=lambda frame: frame.ts_ns))]))
    assert {"NV203", "NV502"} <= {finding.code for finding in found}
    (jitter,) = (finding for finding in found if finding.code == "NV502")
    assert "It comes from telegrams that were overtaken: where none was, jitter is 0" in jitter.message
    assert "(NV203)" in jitter.hint
    assert "loss" not in jitter.message + jitter.hint


def test_where_nothing_counts_nobody_knows_whether_a_late_telegram_is_a_lost_one() -> None:
    frames = [frame for number, frame in enumerate(sent([50] * 200, step=0)) if number not in (60, 61, 62, 120, 150)]
    found = judged(frames)
    assert found["NV501"].message.startswith("1 interval longer than ")
    assert "without a loss" not in found["NV501"].message
    assert found["NV501"].message.endswith("No Counter tells whether telegrams were late or are missing.")
    assert "It comes from intervals of two and more times the nominal one" in found["NV502"].message


def test_intervals_that_scatter_are_no_missing_frames() -> None:
    jitter = judged(sent([40, 60, 70, 20] * 60, step=0), defined(50))["NV502"]
    assert "It comes from" not in jitter.message


def test_jitter_from_loss_that_is_booked_on_another_list_is_none_of_overtaken_telegrams() -> None:
    frames = [
        telegram(b"\0", 1, subindex=0, counter=1 + number, ts_ns=START_NS + number * 25 * MS, list_id=7 + number % 2)
        for number in range(400)
        if number not in (100, 150, 200, 250)
    ]
    found = judge(tracked([batch_of(frames)]))
    assert "NV206" in {finding.code for finding in found}
    (jitter,) = (finding for finding in found if finding.code == "NV502")
    assert "It comes from loss" in jitter.message
    assert "(NV201)" in jitter.hint
