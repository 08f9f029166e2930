"""NV505: cycles of which SubIndexes are missing, and those that nobody can know to be whole."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nvscope.definition.model import Definition
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from tests.definition.lists import BOOL, list_of, telegram
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import batch_of, tracked
from tests.records import replace

MS = 1_000_000
DEFINED = Definition((replace(list_of([BOOL]), interval_ns=50 * MS),))
LEARNED = 9
"""From its so manieth interval on, a stream's interval is known."""

Sent = list[tuple[int, int]]
"""Cycle and SubIndex of what is seen, in order."""


def frames_of(sent: Sent) -> list[Frame]:
    return [
        telegram(b"\0\0", 2, subindex=part, counter=cycle, ts_ns=10**18 + cycle * 50 * MS + part * 200_000, list_id=7)
        for cycle, part in sent
    ]


def torn(frames: list[Frame], cuts: tuple[int, ...] = ()) -> Finding | None:
    pieces = [batch_of(frames[start:stop]) for start, stop in zip((0, *cuts), (*cuts, len(frames)), strict=True)]
    found = [finding for finding in judge(tracked(pieces), definition=DEFINED) if finding.code == "NV505"]
    assert len(found) <= 1
    return found[0] if found else None


def expected(sent: Sent) -> tuple[int, int, tuple[int, ...]]:
    """Return how many cycles are torn, of how many, and the first frames of the first ten of them."""
    parts = {part for _, part in sent}
    places = {part: [place for place, (_, own) in enumerate(sent) if own == part] for part in parts}
    if len(parts) < 2 or any(len(own) <= LEARNED for own in places.values()):
        return 0, 0, ()
    begin = max(own[LEARNED] for own in places.values())
    end = min(own[-1] for own in places.values())
    cycles: dict[int, list[int]] = {}
    for place, (cycle, part) in enumerate(sent):
        if place >= places[part][LEARNED]:
            cycles.setdefault(cycle, []).append(place)
    # The last cycle of all may go on.
    whole = [own for own in list(cycles.values())[:-1] if own[0] >= begin and own[-1] <= end]
    missing = [own for own in whole if len(own) < len(parts)]
    return len(missing), len(whole), tuple(own[0] + 1 for own in missing[:10])


@given(st.integers(2, 4), st.floats(0, 0.2), st.randoms(use_true_random=False))
@examples(60)
def test_cycles_between_the_first_and_the_last_telegrams_of_all_streams(
    parts: int, share: float, choice: random.Random
) -> None:
    stops = {part: choice.choice([200, 200, choice.randrange(20, 120)]) for part in range(parts)}
    begins = {part: choice.choice([0, 0, choice.randrange(60)]) for part in range(parts)}
    sent = [
        (cycle, part)
        for cycle in range(120)
        for part in range(parts)
        if begins[part] <= cycle < stops[part] and choice.random() >= share
    ]
    sent = sent[choice.randrange(parts) : len(sent) - choice.randrange(parts)]
    assume(len(sent) > 3)
    # Where half of a learned interval is longer than one, two cycles are close to each other.
    assume(all(learned_cycles(sent, part) <= 2 for part in range(parts)))
    count, cycles, frames = expected(sent)
    shown = frames_of(sent)
    for cuts in ((), tuple(sorted(choice.sample(range(len(shown)), 3))), tuple(range(1, len(shown), 9))):
        finding = torn(shown, cuts)
        if not count:
            assert finding is None
        else:
            assert finding is not None
            assert (finding.count, finding.frames) == (count, frames)
            assert f"{count} of {cycles} cycle" in finding.message


def learned_cycles(sent: Sent, part: int) -> int:
    """Return the median of the first eight intervals of a SubIndex, in cycles; 1 where it has fewer."""
    cycles = [cycle for cycle, own in sent if own == part][:LEARNED]
    intervals = sorted(after - before for before, after in pairwise(cycles))
    return intervals[len(intervals) // 2] if len(intervals) == LEARNED - 1 else 1


def whole(cycles: range, parts: int = 2) -> Sent:
    return [(cycle, part) for cycle in cycles for part in range(parts)]


@pytest.mark.parametrize("lost", range(1, 12))
def test_a_loss_while_intervals_are_learned_tears_nothing_later(lost: int) -> None:
    """A stream that has lost one of its first telegrams knows its interval a cycle later than the other."""
    for part in (0, 1):
        sent = [which for which in whole(range(60)) if which != (lost, part)]
        finding = torn(frames_of(sent))
        # From cycle 9 or 10 on, it is a cycle that is torn.
        assert (finding.count if finding else 0) == (lost > LEARNED)


@pytest.mark.parametrize(("front", "behind"), [(0, 0), (1, 0), (2, 0), (0, 1), (0, 2), (1, 1), (2, 2)])
def test_a_capture_that_begins_or_ends_inside_a_cycle_tears_nothing(front: int, behind: int) -> None:
    sent = whole(range(40), 3)
    assert torn(frames_of(sent[front : len(sent) - behind])) is None


def test_a_stream_that_begins_later_or_stops_earlier_tears_nothing() -> None:
    for some in (range(30, 90), range(60), range(20, 70)):
        sent = [(cycle, part) for cycle in range(90) for part in range(2) if part == 0 or cycle in some]
        assert torn(frames_of(sent)) is None
        # But a cycle in between is torn.
        sent.remove((45, 1))
        finding = torn(frames_of(sent))
        assert finding is not None
        assert finding.count == 1


def test_a_cycle_that_is_over_only_in_a_later_batch_counts_as_well() -> None:
    """The last telegram of a stream that stops ends a cycle; that it did is known when the next one begins."""
    sent = [one for one in [*whole(range(60)), *((cycle, 0) for cycle in range(60, 90))] if one != (45, 1)]
    shown = frames_of(sent)
    finding = torn(shown)
    assert finding is not None
    _, cycles, _ = expected(sent)
    assert finding.message.startswith(f"1 of {cycles} cycles")
    assert torn(shown, tuple(range(1, len(shown)))) == finding
