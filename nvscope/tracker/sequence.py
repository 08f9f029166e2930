"""Steps of many sequences of counters at once.

``walk`` follows the rule of ``nvscope.tracker.steps.walk_one``: it takes each counter's predecessor for the sequence's
current one, and where telegrams came late finds the current one as a running maximum. Both give the same steps, a law
of the tests.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8, U16, U64, Bool
from nvscope.engine.runs import spans
from nvscope.tracker.steps import EARLY_WRAPS, LATE_FROM, WINDOW, Step, Steps, walk_one

_FAR = WINDOW + 1
_MAX_ROUNDS = 24
_EPOCH_BITS = np.int64(34)
_FEW = 64  # of late counters, up to one in so many is few
_FEW_ODD = 8  # of places whose distance is not 1, the same
_MOST_IN_A_ROW = 16
_PIECE = 256
# From GAP down to the steps of smaller and of greater distances.
_TO_SAME, _TO_REGULAR = np.uint8(Step.GAP - Step.SAME), np.uint8(Step.GAP - Step.REGULAR)
_TO_RESTART, _TO_LATE = np.uint8(Step.GAP - Step.RESTART), np.uint8(Step.RESTART - Step.LATE)


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
    if (distance == 1).all():  # as it mostly is
        step, shifted = np.full(len(counter), Step.REGULAR, np.uint8), _shifted_left(missing, stop - start)
        return Steps(step, distance, counter[stop - 1], shifted, np.empty(0, np.int64))
    return _Walk(counter, start, stop, current, missing, fresh, before, distance).steps()


class _Walk:
    """The workings of ``walk`` where not every step is +1."""

    def __init__(
        self, counter: U16, start: I64, stop: I64, current: U16, missing: U64, fresh: Bool, before: U16, distance: U16
    ) -> None:
        self.counter, self.start, self.stop = counter, start, stop
        self.current, self.missing, self.fresh = current, missing, fresh
        self.before, self.distance = before, distance
        # What is walked one by one in the end: whole sequences, and what is around some places.
        self.by_rule = np.zeros(len(start), np.bool_)
        self.by_rule_at: list[int] = []
        self._look()

    def _look(self) -> None:
        """Find the places whose distance is not 1; where these are few, nothing else is looked at."""
        self.odd = np.flatnonzero(self.distance != 1)
        self.odd_are_few = len(self.odd) * _FEW_ODD < len(self.distance)
        self.looked_at = self.odd if self.odd_are_few else slice(None)

    def _where(self, holds: Bool) -> I64:
        """Return the places of which something holds, as told of those that are looked at."""
        found = np.flatnonzero(holds)
        return self.odd[found] if self.odd_are_few else found

    def steps(self) -> Steps:
        """Return the steps; call once."""
        after = self.counter[self.stop - 1]
        late = self._where(self.distance[self.looked_at] >= LATE_FROM)
        if len(late):
            if len(late) * _FEW >= len(self.counter) or not self._settle_few(after, late[self.counter[late] > 1]):
                after = self._settle(after)
            self._look()
            late = self._where(self.distance[self.looked_at] >= LATE_FROM)
        step = self._judge()
        heights = self._heights(late, step)
        base = np.where(self.start > 0, heights.at(self.start - 1), 0)
        taken_at, behind = self._overtaken(late, step, heights, base) if len(late) else (late, late)
        missing = self._missing_after(step, heights, base, taken_at, behind)
        steps = Steps(step, self.distance, after, missing, late)
        if self.by_rule.any() or self.by_rule_at:
            self._walk_by_rule(steps)
            self._look()
        steps.irregular = self._where(step[self.looked_at] != Step.REGULAR)
        return steps

    def _judge(self) -> U8:
        """Tell the steps, taking every late counter for one that was there before."""
        distance = self.distance[self.looked_at]
        # Counted down from GAP: for all places at once that is faster than to assign where a mask is set.
        step = np.uint8(Step.GAP) - (distance >= 32768).view(np.uint8) * _TO_RESTART
        step -= (distance >= LATE_FROM).view(np.uint8) * _TO_LATE
        step -= (distance == 0).view(np.uint8) * _TO_SAME
        step -= (distance == 1).view(np.uint8) * _TO_REGULAR
        if self.odd_are_few:
            odd_step, step = step, np.full(len(self.distance), Step.REGULAR, np.uint8)
            step[self.odd] = odd_step
        distance = self.distance
        lowest = self._where(self.counter[self.looked_at] <= 1)
        before = self.before[lowest]
        wraps = (self.counter[lowest] == 0) & ((before == EARLY_WRAPS[0]) | (before == EARLY_WRAPS[1]))
        step[lowest[wraps]] = Step.REGULAR
        step[lowest[(before < 65534) & (distance[lowest] > 1) & ~wraps]] = Step.RESTART
        step[self.start[self.fresh]] = Step.NONE
        return step

    def _heights(self, late: I64, step: U8) -> _Heights:
        """Return the heights around late counters and at the ends of the sequences, as far as these look back.

        That is no further than to the last step that leaves all behind it; where counters jump, nearly every one does.
        """
        asked = np.sort(np.concatenate([late, self.stop - 1]))
        far = self._where(self.distance[self.looked_at] - np.uint16(_FAR) < LATE_FROM - _FAR)
        begin = np.maximum(
            self.start[np.searchsorted(self.start, asked, "right") - 1],
            np.append(far, 0)[np.searchsorted(far, asked, "right") - 1],
        )
        first, last = np.searchsorted(self.odd, begin), np.searchsorted(self.odd, asked, "right")
        first[1:] = np.maximum(first[1:], last[:-1])
        places = self.odd[spans(first, last - first)]
        distance = self.distance[places]
        advance = np.minimum(distance, _FAR)
        advance[distance >= LATE_FROM] = 0
        advance[step[places] == Step.RESTART] = _FAR
        return _Heights(advance, places, len(self.counter))

    def _settle_few(self, after: U16, late: I64) -> bool:
        """Mend ``before``, ``distance`` and ``after`` behind single late counters; False, and nothing, if in long rows.

        Behind a late counter the current one stays, until one comes that is not late.
        """
        sequence = np.searchsorted(self.start, late, "right") - 1
        current, stop = self.before[late], self.stop[sequence]
        resume = late + 1
        open_ = np.arange(len(late))
        for _ in range(_MOST_IN_A_ROW):
            open_ = open_[resume[open_] < stop[open_]]
            if not len(open_):
                break
            counter = self.counter[resume[open_]]
            resume[open_] += 1
            open_ = open_[(counter - current[open_] >= LATE_FROM) & (counter > 1)]
        else:
            return False
        # What another late counter has settled already is not looked at again.
        settled = 0
        heads = []
        for head, (place, behind) in enumerate(zip(late.tolist(), resume.tolist(), strict=True)):
            if place >= settled:
                heads.append(head)
                settled = behind
        late, resume, current = late[heads], resume[heads], current[heads]
        length = resume - late
        place = np.arange(int(length.sum())) + np.repeat(late - np.cumsum(length) + length, length)
        kept = np.repeat(current, length)
        self.before[place] = kept
        self.distance[place] = self.counter[place] - kept
        # A run that goes on to the end of its sequence leaves the current counter there.
        ends = (resume == stop[heads]) & self._is_late(resume - 1)
        after[sequence[heads][ends]] = current[ends]
        return True

    def _is_late(self, place: I64) -> Bool:
        late: Bool = (self.distance[place] >= LATE_FROM) & (self.counter[place] > 1)
        return late

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
            self.by_rule[np.flatnonzero(concerned)[sequences]] = True
        current = top.astype(np.uint16)
        before = np.empty_like(counter)
        before[1:] = current[:-1]
        before = before[real]
        self.before[inside] = before
        self.distance[inside] = self.counter[inside] - before
        after = after.copy()
        after[concerned] = current[stop - 1]
        return after

    def _overtaken(self, late: I64, step: U8, heights: _Heights, base: I64) -> tuple[I64, I64]:
        """Tell which late counters were missing, and mark the first taker of each as overtaken in ``step``.

        ``base`` is the height in front of each sequence: the place that first reaches a late counter's height has
        either that counter, or the step that passed over it.
        Returns, for those marked, the place of that step (−1 − sequence: missing since before), and how far the counter
        is behind the current counter after that step.
        """
        sequence = np.searchsorted(self.start, late, "right") - 1
        counter = self.counter[late]
        target = heights.at(late) - (65536 - self.distance[late].astype(np.int64))
        restarts = (counter <= 1) & (step[late] == Step.RESTART)
        target[restarts] += -_FAR  # its own step is in the height
        place = heights.first_reaching(target)
        since = target < base[sequence]
        place[since] = 0
        top = heights.at(place)
        passed = ~since & (top > target) & (step[place] == Step.GAP) & (target > base[sequence])
        bit = np.clip(base[sequence] - target - 1, 0, WINDOW - 1).astype(np.uint64)
        was = since & ~self.fresh[sequence] & (base[sequence] - target <= WINDOW)
        was &= (self.missing[sequence] >> bit) & np.uint64(1) == 1
        found = np.flatnonzero(passed | was)
        origin = np.where(since[found], -1 - sequence[found], place[found])
        behind = np.where(since[found], base[sequence[found]], top[found]) - target[found]
        _, first = np.unique(origin * 65536 + counter[found], return_index=True)
        taker = found[first]
        # A missing 0 or 1 that comes late was taken for a restart above: what follows it is then wrong.
        self.by_rule_at = late[taker[counter[taker] <= 1]].tolist()
        step[late[taker]] = Step.OVERTAKEN
        return origin[first], behind[first]

    def _missing_after(self, step: U8, heights: _Heights, base: I64, taken_at: I64, taken_behind: I64) -> U64:
        """Return the missing words after the last steps."""
        end = heights.at(self.stop - 1)
        since_start = end - base
        word = _shifted_left(self.missing, since_start)
        word[self.fresh] = 0
        # Only the last places of a sequence are within the window.
        begin = np.maximum(heights.first_reaching(end - WINDOW + 1), self.start)
        length = self.stop - begin
        near = np.arange(int(length.sum())) + np.repeat(begin - np.cumsum(length) + length, length)
        chosen = np.flatnonzero(step[near] == Step.GAP)
        if len(chosen):
            gaps, sequence = near[chosen], np.repeat(np.arange(len(length)), length)[chosen]
            after = end[sequence] - heights.at(gaps)
            lost = np.minimum(self.distance[gaps].astype(np.int64) - 1, WINDOW - after)
            np.bitwise_or.at(word, sequence, _ones(lost) << after.astype(np.uint64))
        if len(taken_at):
            since = taken_at < 0
            place = np.maximum(taken_at, 0)
            sequence = np.where(since, -1 - taken_at, np.searchsorted(self.start, place, "right") - 1)
            behind = taken_behind + np.where(since, since_start[sequence], end[sequence] - heights.at(place))
            close = behind <= WINDOW
            np.bitwise_and.at(word, sequence[close], ~(np.uint64(1) << (behind[close] - 1).astype(np.uint64)))
        return word

    def _walk_by_rule(self, steps: Steps) -> None:
        """Walk one by one what the bulk may have got wrong."""
        for sequence in np.flatnonzero(self.by_rule).tolist():
            self._walk_piece(steps, sequence, int(self.start[sequence]), int(self.stop[sequence]))
        walked = 0
        for place in sorted(self.by_rule_at):
            sequence = int(np.searchsorted(self.start, place, "right")) - 1
            if place < walked or self.by_rule[sequence]:
                continue
            # A restart leaves nothing behind: from the one before, and up to where the rule meets one, all is as it is.
            start, stop = int(self.start[sequence]), int(self.stop[sequence])
            restarts = start + np.flatnonzero(steps.step[start:place] == Step.RESTART)
            begin = int(restarts[-1]) + 1 if len(restarts) else start
            walked = self._walk_piece(steps, sequence, begin, stop, place)

    def _walk_piece(self, steps: Steps, sequence: int, begin: int, stop: int, place: int = -1) -> int:
        """Walk from ``begin`` to ``stop``, or to a restart behind ``place`` that is in the steps too; return where.

        Unless at the start of the sequence, ``begin`` is behind a restart. Without a place it goes to ``stop``.
        """
        current: int | None = None
        missing = 0
        if begin > self.start[sequence]:
            current = int(self.counter[begin - 1])
        elif not self.fresh[sequence]:
            current, missing = int(self.current[sequence]), int(self.missing[sequence])
        while begin < stop:
            # Piece by piece: a restart may be near.
            end = min(stop, max(place + 1, begin) + _PIECE)
            counters = self.counter[begin:end].tolist()
            step, distance, current, missing = walk_one(counters, current, missing)
            common = np.flatnonzero((steps.step[begin:end] == Step.RESTART) & (np.array(step) == Step.RESTART))
            common = common[common + begin > place] if place >= 0 else common[:0]
            if len(common):
                end = begin + int(common[0]) + 1
            part = slice(begin, end)
            steps.step[part], steps.distance[part] = step[: end - begin], distance[: end - begin]
            begin = end
            if len(common):
                return end
        assert current is not None
        steps.current[sequence], steps.missing[sequence] = current, missing
        return stop


class _Heights:
    """How far the steps up to each place have moved the current counter on, in numbers that do not wrap.

    Regular steps move it on by 1, so that the others tell everything: ``advance`` are theirs, at ``places`` (rising).
    """

    def __init__(self, advance: U16, places: I64, count: int) -> None:
        # In front of the first one stands a step of 0.
        self._places = np.concatenate([[-1], places])
        moved = advance.astype(np.int64)
        moved -= 1  # more than a regular step
        self._heights = np.zeros(len(places) + 1, np.int64)
        np.cumsum(moved, out=self._heights[1:])
        self._heights += self._places
        self._heights += 1
        self._count = count

    def at(self, place: I64) -> I64:
        """Return the heights at places; 0 at -1."""
        known = np.searchsorted(self._places, place, "right") - 1
        height: I64 = self._heights[known] + place - self._places[known]
        return height

    def first_reaching(self, height: I64) -> I64:
        """Return the first place of at least each height; the number of places where there is none."""
        above = np.searchsorted(self._heights, height)
        below = np.maximum(above - 1, 0)
        place = self._places[below] + np.maximum(height - self._heights[below], 0)
        first: I64 = np.minimum(place, np.append(self._places, self._count)[above])
        return first


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
    full = np.uint64(0xFFFF_FFFF_FFFF_FFFF)
    return np.where(count > 0, full >> np.clip(WINDOW - count, 0, WINDOW - 1).astype(np.uint64), np.uint64(0))
