"""Steps of counters: what each telegram's Counter says about those before it (loss, overtaking, restarts).

``walk_one`` is the rule, one counter after the other. ``walk`` is the same rule for many sequences at once: it takes
each counter's predecessor for the sequence's current one, and where telegrams came late finds the current one as a
running maximum. Both give the same steps, a law of the tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from dissectors.batch import I64, U8, U16, U64, Bool

WINDOW = 64
"""A skipped counter counts as missing while it is at most this far behind: one bit each of a 64-bit word."""

LATE_FROM = 65536 - WINDOW
EARLY_WRAPS = (255, 65534)
"""Counters after which some senders go on with 0."""

_MASK = (1 << 64) - 1
_FAR = WINDOW + 1
_MAX_ROUNDS = 24
_EPOCH_BITS = np.int64(34)
_FEW = 64  # one late counter in so many is walked singly


class Step(IntEnum):
    """What a telegram does to a sequence of counters."""

    NONE = 0  # the first of its sequence: no step
    REGULAR = 1
    SAME = 2  # the current counter again: a duplicate, or nothing, or regular, as the scope has it
    OVERTAKEN = 3
    LATE = 4  # a counter that was there before
    RESTART = 5
    GAP = 6


# Plain integers: the loop below takes a third of the time with them.
_NONE, _REGULAR, _SAME, _OVERTAKEN, _LATE, _RESTART, _GAP = (int(step) for step in Step)
_MOVING = (_REGULAR, _GAP, _RESTART)


@dataclass(slots=True)
class Steps:
    """The steps of some sequences laid end to end.

    ``step`` uint8 (``Step``) and ``distance`` uint16 (counter less current counter, mod 65536) have one entry a
    telegram; a GAP of distance d has lost d − 1. ``current`` uint16 and ``missing`` uint64 have one entry a sequence,
    after its last step; bit i of ``missing`` stands for the counter i + 1 behind the current one. ``irregular`` are the
    places whose step is not REGULAR, rising.
    """

    step: U8
    distance: U16
    current: U16
    missing: U64
    irregular: I64


def walk_one(counters: list[int], current: int | None, missing: int) -> tuple[list[int], list[int], int, int]:
    """Walk one sequence; return its steps, distances, and the current counter and missing word after them.

    ``current`` is None where the sequence begins with these counters, of which there must be at least one.
    """
    steps: list[int] = []
    distances: list[int] = []
    for counter in counters:
        if current is None:
            current = counter
            steps.append(_NONE)
            distances.append(0)
            continue
        distance = (counter - current) & 0xFFFF
        behind = 65536 - distance
        if distance == 1 or (counter == 0 and current in EARLY_WRAPS):
            step = _REGULAR
            missing = missing << distance & _MASK if distance <= WINDOW else 0
        elif distance == 0:
            step = _SAME
        elif behind <= WINDOW and missing >> (behind - 1) & 1:
            step = _OVERTAKEN
            missing &= ~(1 << (behind - 1))
        elif counter <= 1 and current < 65534:
            step = _RESTART
        elif distance < 32768:
            step = _GAP
            missing = (missing << distance | ((1 << (distance - 1)) - 1)) & _MASK if distance <= WINDOW else _MASK
        elif distance >= LATE_FROM:
            step = _LATE
        else:
            step = _RESTART
        if step == _RESTART:
            missing = 0
        if step in _MOVING:
            current = counter
        steps.append(step)
        distances.append(distance)
    assert current is not None
    return steps, distances, current, missing


# What a distance alone tells, before counters 0 and 1 are looked at; and by how much it moves the current counter on.
_STEP_OF_DISTANCE = np.full(65536, Step.GAP, np.uint8)
_STEP_OF_DISTANCE[32768:LATE_FROM] = Step.RESTART
_STEP_OF_DISTANCE[LATE_FROM:] = Step.LATE
_STEP_OF_DISTANCE[:2] = (Step.SAME, Step.REGULAR)
_ADVANCE_OF_DISTANCE = np.minimum(np.arange(65536), _FAR).astype(np.uint8)
_ADVANCE_OF_DISTANCE[LATE_FROM:] = 0


def walk(counter: U16, start: I64, current: U16, missing: U64, fresh: Bool) -> Steps:
    """Walk many sequences laid end to end.

    ``counter`` has shape (n,); sequence i has the places from ``start[i]`` to ``start[i + 1]`` (to n for the last) and
    is not empty. ``current`` and ``missing`` are what it had before; where ``fresh`` it begins here.
    """
    before = np.empty_like(counter)
    before[1:] = counter[:-1]
    before[start] = np.where(fresh, counter[start], current)
    distance = counter - before
    stop = np.append(start[1:], len(counter))
    if (distance == 1).all():
        shifted = _shifted_left(missing, stop - start)
        step = np.full(len(counter), Step.REGULAR, np.uint8)
        return Steps(step, distance, counter[stop - 1], shifted, np.empty(0, np.int64))
    walked = _Walk(counter, start, stop, current, missing, fresh, before, distance)
    return walked.steps()


class _Walk:
    """The workings of ``walk`` where not every step is +1."""

    def __init__(
        self, counter: U16, start: I64, stop: I64, current: U16, missing: U64, fresh: Bool, before: U16, distance: U16
    ) -> None:
        self.counter, self.start, self.stop = counter, start, stop
        self.current, self.missing, self.fresh = current, missing, fresh
        self.before, self.distance = before, distance
        self.by_rule = np.zeros(len(start), np.bool_)  # sequences that are walked one by one in the end

    def steps(self) -> Steps:
        """Return the steps; call once."""
        after = self.counter[self.stop - 1]
        late = np.flatnonzero(self.distance >= LATE_FROM)
        if len(late):
            few = len(late) * _FEW < len(self.counter)
            after = self._settle_few(after, late[self.counter[late] > 1]) if few else self._settle(after)
        step = self._judge()
        advance = _ADVANCE_OF_DISTANCE[self.distance]
        advance[self.start[self.fresh]] = 0
        advance[self.restarted] = _FAR
        total = np.cumsum(advance, dtype=np.int64)
        base = np.where(self.start > 0, total[self.start - 1], 0)
        late = np.flatnonzero(self.distance >= LATE_FROM)
        taken_at, behind = self._overtaken(late, step, total, base) if len(late) else (late, late)
        missing = self._missing_after(step, total, base, taken_at, behind)
        steps = Steps(step, self.distance, after, missing, np.empty(0, np.int64))
        if self.by_rule.any():
            self._walk_by_rule(steps)
        steps.irregular = np.flatnonzero(step != Step.REGULAR)
        return steps

    def _judge(self) -> U8:
        """Tell the steps, taking every late counter for one that was there before."""
        step = _STEP_OF_DISTANCE[self.distance]
        lowest = np.flatnonzero(self.counter <= 1)
        counter, before, distance = self.counter[lowest], self.before[lowest], self.distance[lowest]
        wraps = (counter == 0) & ((before == EARLY_WRAPS[0]) | (before == EARLY_WRAPS[1]))
        self.restarted = lowest[(before < 65534) & (distance > 1) & ~wraps]
        step[lowest[wraps]] = Step.REGULAR
        step[self.restarted] = Step.RESTART
        step[self.start[self.fresh]] = Step.NONE
        return step

    def _settle_few(self, after: U16, late: I64) -> U16:
        """Mend ``before`` and ``distance`` behind single late counters; return the last current ones.

        Does one by one what ``_settle`` does for all: the current counter stays until one comes that is not late.
        """
        after = after.copy()
        resume = 0
        for place, sequence in zip(
            late.tolist(), (np.searchsorted(self.start, late, "right") - 1).tolist(), strict=True
        ):
            if place < resume:
                continue
            current, stop = int(self.before[place]), int(self.stop[sequence])
            at = place
            while at < stop:
                counter = int(self.counter[at])
                distance = (counter - current) & 0xFFFF
                self.before[at], self.distance[at] = current, distance
                if distance < LATE_FROM or counter <= 1:
                    break
                at += 1
            else:
                after[sequence] = current
            resume = at + 1
        return after

    def _settle(self, after: U16) -> U16:
        """Mend ``before`` and ``distance`` in the sequences that hold late counters; return the last current ones.

        The current counter is the running maximum, in numbers that do not wrap, of the counters since the last break: a
        place more than 64 behind it, where it goes back. Breaks are found by taking the places that the running maximum
        shows for breaks, and again, until nothing changes; each round is right at least one place further, usually
        everywhere. Counters 0 and 1 always break: unless missing, they are a restart (``_overtaken`` looks at those).
        """
        length = self.stop - self.start
        concerned = np.add.reduceat(self.distance >= LATE_FROM, self.start, dtype=np.int64) > 0
        everything = bool(concerned.all())
        inside = slice(None) if everything else np.flatnonzero(np.repeat(concerned, length))
        length = length[concerned]
        # In front of each sequence, a place for the counter that it had before.
        stop = np.cumsum(length + 1)
        start = stop - length - 1
        real = np.ones(stop[-1], np.bool_)
        real[start] = False
        counter = np.empty(stop[-1], np.uint16)
        counter[real] = self.counter[inside]
        first = self.counter[self.start[concerned]]
        counter[start] = np.where(self.fresh[concerned], first, self.current[concerned])

        height = np.empty(len(counter), np.int64)
        height[0] = counter[0]
        height[1:] = (counter[1:] - counter[:-1]).view(np.int16)
        np.cumsum(height, out=height)
        always = counter <= 1
        always[1:] |= height[1:] - height[:-1] < -WINDOW
        always[start] = True
        breaks = always
        for _ in range(_MAX_ROUNDS):
            top = np.maximum.accumulate((np.cumsum(breaks) << _EPOCH_BITS) + height)
            again = always.copy()
            again[1:] |= _within_epoch(top[:-1]) - height[1:] > WINDOW
            changed = again != breaks
            breaks = again
            if not changed.any():
                break
        else:
            sequences = np.searchsorted(start, np.flatnonzero(changed), "right") - 1
            self.by_rule[np.flatnonzero(concerned)[np.unique(sequences)]] = True
        current = top.astype(np.uint16)
        before = np.empty_like(counter)
        before[1:] = current[:-1]
        before = before[real]
        self.before[inside] = before
        self.distance[inside] = self.counter[inside] - before
        after = after.copy()
        after[concerned] = current[stop - 1]
        return after

    def _overtaken(self, late: I64, step: U8, total: I64, base: I64) -> tuple[I64, I64]:
        """Tell which late counters were missing, and mark the first taker of each as overtaken in ``step``.

        ``total`` is the running sum of the steps forward, ``base`` its value in front of each sequence: the place where
        it first reaches a late counter's height has either that counter, or the step that passed over it.
        Returns, for those marked, the place of that step (−1 − sequence: missing since before), and how far the counter
        is behind the current counter after that step.
        """
        sequence = np.searchsorted(self.start, late, "right") - 1
        counter = self.counter[late]
        target = total[late] - (65536 - self.distance[late].astype(np.int64))
        restarts = (counter <= 1) & (step[late] == Step.RESTART)
        target[restarts] += -_FAR  # its own step is in the total
        place = np.searchsorted(total, target)
        since = target < base[sequence]
        place[since] = 0
        passed = ~since & (total[place] > target) & (step[place] == Step.GAP) & (target > base[sequence])
        bit = np.clip(base[sequence] - target - 1, 0, WINDOW - 1).astype(np.uint64)
        was = since & ~self.fresh[sequence] & (base[sequence] - target <= WINDOW)
        was &= (self.missing[sequence] >> bit) & np.uint64(1) == 1
        found = np.flatnonzero(passed | was)
        origin = np.where(since[found], -1 - sequence[found], place[found])
        behind = np.where(since[found], base[sequence[found]], total[place[found]]) - target[found]
        _, first = np.unique(origin * 65536 + counter[found], return_index=True)
        taker = found[first]
        # A missing 0 or 1 that comes late was taken for a restart above: what follows it is then wrong.
        self.by_rule[sequence[taker[counter[taker] <= 1]]] = True
        step[late[taker]] = Step.OVERTAKEN
        return origin[first], behind[first]

    def _missing_after(self, step: U8, total: I64, base: I64, taken_at: I64, taken_behind: I64) -> U64:
        """Return the missing words after the last steps."""
        end = total[self.stop - 1]
        since_start = end - base
        word = _shifted_left(self.missing, since_start)
        word[self.fresh] = 0
        after = np.repeat(end, self.stop - self.start) - total
        gaps = np.flatnonzero((step == Step.GAP) & (after < WINDOW))
        if len(gaps):
            sequence = np.searchsorted(self.start, gaps, "right") - 1
            lost = np.minimum(self.distance[gaps].astype(np.int64) - 1, WINDOW - after[gaps])
            np.bitwise_or.at(word, sequence, _ones(lost) << after[gaps].astype(np.uint64))
        if len(taken_at):
            since = taken_at < 0
            place = np.maximum(taken_at, 0)
            sequence = np.where(since, -1 - taken_at, np.searchsorted(self.start, place, "right") - 1)
            behind = taken_behind + np.where(since, since_start[sequence], after[place])
            near = behind <= WINDOW
            np.bitwise_and.at(word, sequence[near], ~(np.uint64(1) << (behind[near] - 1).astype(np.uint64)))
        return word

    def _walk_by_rule(self, steps: Steps) -> None:
        for sequence in np.flatnonzero(self.by_rule):
            part = slice(int(self.start[sequence]), int(self.stop[sequence]))
            current = None if self.fresh[sequence] else int(self.current[sequence])
            missing = 0 if self.fresh[sequence] else int(self.missing[sequence])
            step, distance, after, word = walk_one(self.counter[part].tolist(), current, missing)
            steps.step[part], steps.distance[part] = step, distance
            steps.current[sequence], steps.missing[sequence] = after, word


def _within_epoch(top: I64) -> I64:
    """Take the epoch off a running maximum; heights may be negative, so that they borrow from it."""
    half = np.int64(1) << (_EPOCH_BITS - 1)
    return ((top + half) & ((np.int64(1) << _EPOCH_BITS) - 1)) - half


def _shifted_left(word: U64, by: I64) -> U64:
    """Shift words left by any number of bits; numpy leaves shifts of 64 and more undefined."""
    near = by < WINDOW
    shifted: U64 = (word << np.where(near, by, 0).astype(np.uint64)) * near.astype(np.uint64)
    return shifted


def _ones(count: I64) -> U64:
    """Return words with their lowest ``count`` bits set, 0 to 64."""
    full = np.uint64(_MASK)
    return np.where(count > 0, full >> np.clip(WINDOW - count, 0, WINDOW - 1).astype(np.uint64), np.uint64(0))
