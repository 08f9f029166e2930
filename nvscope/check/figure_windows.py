"""Figures of lists, window by window: whether an expression over them is what it should be."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any, ClassVar

import numpy as np

from nvscope.check.asked_rows import EVERY_LIST, OfLists
from nvscope.check.check import Evidence, Setting
from nvscope.check.doubt import doubt_of_ends, doubt_of_several
from nvscope.check.parameters import Unfit
from nvscope.check.so_spans import whole_windows
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.while_so import NO_WHOLE_WINDOW, while_so
from nvscope.check.window_counts import COUNTED, Counted, WindowCounts
from nvscope.engine.keys import Keys
from nvscope.engine.told import Told
from nvscope.errors import UsageError
from nvscope.expression.expression import Expression, compile_expression
from nvscope.expression.typed_columns import Column, FieldType, Named, TextColumn
from nvscope.list_key import ListKey
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.tracker.figures import BY_NAME, Of, Value, figures_of
from nvscope.tracker.measured import Measured
from nvscope.tracker.subjects import subjects
from nvscope.tracker.windows import Window, Windows
from nvscope.units import count_of
from nvscope.view.fields.verdicts import TYPES

_SECOND_NS = 1_000_000_000
_PREFIX = "list."
_RATE = "rate"
_LEAST_NS = 100_000_000
"""Figures of intervals and answers are looked at in windows of so long at least: each is a look at the whole state."""


class FigureWindows:
    """An observer of the figures of each list in windows, end to end; an incomplete last one is left out.

    An expression over them is ``wanted`` to be true, or false, of each window; where it is not, for no longer than
    ``limit_ns``. What telegrams and events count is counted by ``counts``; other figures are looked up, in ``windows``,
    on whose cut source it has to be run then. Several rules have either in common.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, text: str, length_ns: int, limit_ns: int, *, wanted: bool) -> None:
        self._expression = _compiled(text)
        self._setting, self._wanted = setting, wanted
        self._lists = OfLists(patterns=setting.lists) if setting.lists else EVERY_LIST
        self._length_ns, self._limit_ns, self.holds = length_ns, limit_ns, while_so(setting)
        self._runs: dict[int, _Run] = {}
        self._numbers: Keys | None = None
        self.counts: WindowCounts | None = None
        self.windows: SharedWindows | None = None
        if {name.removeprefix(_PREFIX) for name in self._expression.fields} <= {*COUNTED, _RATE}:
            self.counts = setting.shared(("counts", length_ns), lambda: WindowCounts(setting, length_ns))
            names = (name.removeprefix(_PREFIX) for name in self._expression.fields)
            self.counts.want(self._lists, (name for name in names if name != _RATE))
        elif length_ns < _LEAST_NS:
            raise Unfit(
                "windows of figures of intervals and answers are 100 ms long at least", "window",
                next_step=f"shorter ones are for {', '.join(COUNTED)}",
            )  # fmt: skip
        else:
            self.windows = setting.shared(("windows", length_ns), lambda: SharedWindows(setting, length_ns))

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if self.holds is not None:
            self.holds.see(told)
        self._numbers = told.keys
        if self.counts is not None:
            self.counts.observe(told)
            for counted in self.counts.ended:
                self._take_counts(self._runs, counted, told.keys)
        if self.windows is not None:
            self.windows.observe(told)
            for summaries in self.windows.ended:
                self._take_summary(summaries, told)

    def _take_counts(self, runs: dict[int, _Run], counted: Counted, keys: Keys) -> None:
        mask = self._setting.rows.mask(self._lists, keys)
        row = np.flatnonzero(mask[counted.list])
        fine = self._is_fine(counted, row)
        empty = self._is_fine(None, np.zeros(1, np.int64))[0]
        lost = counted.values["lost"][row] if "lost" in counted.values else np.zeros(len(row), np.int64)
        columns: list[Any] = [counted.list[row], counted.window[row], counted.frame[row], fine, lost]
        count = np.ones(len(row), np.int64)
        if self.holds is None:
            # Of windows in a row that are as they should be, nothing but their number is wanted.
            begins = (np.diff(columns[0]) != 0) | (np.diff(columns[1]) != 1) | ~fine[1:] | ~fine[:-1]
            begin = np.flatnonzero(np.append(True, begins)[: len(row)])
            count = np.diff(begin, append=len(row))
            columns = [one[begin] for one in columns]

        def judged(first: int, stop: int) -> Iterator[tuple[int, int]]:
            return self._judged_of(counted.begin_ns, first, stop)

        rows = zip(*(one.tolist() for one in (*columns, count)), strict=True)
        for number, window, frame, is_fine, missing, many in rows:
            run = runs.setdefault(number, _Run(self._length_ns, self._limit_ns))
            run.pass_by(window, empty, counted.begin_ns, judged)
            if any(judged(window, window + many)):
                run.take(window, many, is_fine, counted.begin_ns, frame, missing)
            else:
                run.leave_out(window + many)
        for run in runs.values():
            run.pass_by(counted.until, empty, counted.begin_ns, judged)
            if counted.breaks:
                run.break_off()

    def _judged_of(self, begin_ns: int, first: int, stop: int) -> Iterator[tuple[int, int]]:
        """Yield which windows are judged, from one to before another, of those from ``first`` to before ``stop``."""
        if self.holds is None:
            return iter([(first, stop)])
        return whole_windows(self.holds.spans, begin_ns, self._length_ns, first, stop)

    def _is_fine(self, counted: Counted | None, row: Any) -> Any:
        """Tell of which windows the expression is as it is wanted; of None, of one in which nothing came."""

        def column(name: str) -> tuple[Column, Any]:
            figure = name.removeprefix(_PREFIX)
            own = COUNTED[0] if figure == _RATE else figure
            values = np.zeros(len(row), np.int64) if counted is None else counted.values[own][row]
            return (values * _SECOND_NS / self._length_ns if figure == _RATE else values), None

        true, _ = self._expression.told(column)
        return true == self._wanted

    def _take_summary(self, found: Ended, told: Told) -> None:
        mask = self._setting.rows.mask(self._lists, told.keys)
        own = [place for place, number in enumerate(found.lists) if mask[number]]
        if not own:
            return
        measured = [found.measured[place] for place in own]
        true, is_known = self._expression.told(lambda name: _column(name, measured))
        window, count = found.window, found.count
        for place, number in enumerate(found.lists[place] for place in own):
            if is_known is None or is_known[place]:
                run = self._runs.setdefault(number, _Run(self._length_ns, self._limit_ns))
                begin_ns = window.start_ns - window.number * self._length_ns
                for first, stop in self._judged_of(begin_ns, window.number, window.number + count):
                    run.skip_to(first)
                    run.take(first, stop - first, bool(true[place]) == self._wanted, begin_ns, None)

    def _up_to(self, until_ns: int | None) -> Mapping[int, _Run]:
        """Return what there is of each list when all windows are over that have ended by a time."""
        if self.counts is None or self._numbers is None or until_ns is None:
            return self._runs
        rest = self.counts.rest(until_ns)
        if rest is None:
            return self._runs
        runs = deepcopy(self._runs)
        self._take_counts(runs, rest, self._numbers)
        return runs

    @property
    def _why_none(self) -> str:
        return "no whole window of it is there" if self.holds is None else NO_WHOLE_WINDOW

    def judged(self, known: Evidence, lists: Collection[ListKey]) -> Iterator[Judged]:
        """Yield a verdict for each list that came; what is below the limit is not told."""
        limit = self._limit_ns / _SECOND_NS
        runs = {known.keys[number]: (number, run) for number, run in self._up_to(known.until_ns).items()}
        counters = {one.list: one.measured.counters for one in known.of(Of.LIST, lists)}
        of_counters = any(name.removeprefix(_PREFIX) in _OF_COUNTERS for name in self._expression.fields)
        for key in sorted(lists):
            number, run = runs.get(key, (-1, None))
            if run is None and not self._setting.lists and runs:
                continue
            if run is None or not run.windows:
                yield Judged(Verdict.INCONCLUSIVE, key, reason=self._why_none, limit=limit, unit="s")
                continue
            if of_counters and number in counters and counters[number].get("lost") is None:
                yield Judged(Verdict.INCONCLUSIVE, key, reason=_NOT_BELIEVED, limit=limit, unit="s")
                continue
            if of_counters and not run.broken and known.counts_nothing(number):
                yield Judged(Verdict.INCONCLUSIVE, key, reason=_NOT_BELIEVED, limit=limit, unit="s")
                continue
            verdict = Verdict.FAIL if run.broken else Verdict.PASS
            reason = f"{run.broken} of {count_of(run.windows, 'window')}" if run.broken else ""
            needed, half_ns = max(run.broken, run.lost), self._length_ns // 2
            why = doubt_of_several(known, [one + half_ns for one in run.times_ns], needed, half_ns)
            if why or (run.broken == 1 and (why := doubt_of_ends(known, run.first_ns))):
                verdict, reason = Verdict.INCONCLUSIVE, why
            yield Judged(
                verdict, key, reason=reason, worst=run.longest_ns / _SECOND_NS, limit=limit, unit="s",
                count=run.broken, first_ns=run.first_ns, frames=tuple(run.frames),
            )  # fmt: skip


_OF_COUNTERS = ("lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts")
_NOT_BELIEVED = "its counters tell nothing: nobody knows what was lost"


_JudgedOf = Callable[[int, int], Iterator[tuple[int, int]]]
"""Which windows are judged, from one to before another, of those from one number to before another."""


class Ended:
    """A window that has ended, how many like it there are in a row, and what was measured of each list in it."""

    def __init__(self, window: Window, count: int, nominal_ns: Mapping[ListKey, int]) -> None:
        self.window, self.count = window, count
        found = [one for one in subjects(window.counted.summary(intervals_ns=nominal_ns)) if one.of is Of.LIST]
        self.lists = [one.list for one in found if one.list is not None]
        self.measured: Sequence[Measured] = [one.measured for one in found if one.list is not None]


class SharedWindows:
    """Windows that several rules look at; ``ended`` are those that ended with the last batch, where somebody listened.

    Empty ones that follow each other are told as one.
    """

    def __init__(self, setting: Setting, length_ns: int) -> None:
        self.windows = Windows(length_ns, setting.since_ns)
        self._nominal_ns = setting.nominal_ns
        self._holes: list[tuple[int, int | None]] = []
        """Since when nobody listened, and until when; None: still."""

        self._told: Told | None = None
        self.ended: list[Ended] = []

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far; several rules may hand over the same one."""
        if self._told is told:
            return
        self._told = told
        if len(told) and self._holes and self._holes[-1][1] is None:
            self._holes[-1] = self._holes[-1][0], int(told.packets.ts_ns.min())
        self.windows.observe(told)
        self.ended = [
            Ended(window, count, self._nominal_ns)
            for window, count in self.windows.ended()
            if not self._is_in_hole(window, count)
        ]
        self._holes += [(one.until_ns, None) for one in told.unheard if one.everything]

    def _is_in_hole(self, window: Window, count: int) -> bool:
        end_ns = window.end_ns + (count - 1) * self.windows.length_ns
        return any(since < end_ns and (until is None or window.start_ns < until) for since, until in self._holes)


class _Run:
    """The windows of one list: how many were otherwise than wanted, and the longest time of such ones in a row."""

    def __init__(self, length_ns: int, limit_ns: int) -> None:
        self._length_ns = length_ns
        self._allowed = limit_ns // length_ns
        self.windows = self.broken = 0
        self.lost = 0
        """How many telegrams were lost in those that were otherwise."""

        self.longest_ns = 0
        self.first_ns: int | None = None
        self.frames: list[int] = []
        self.times_ns: list[int] = []
        self._in_a_row = 0
        self._next: int | None = None

    def pass_by(self, window: int, is_fine: bool, begin_ns: int, judged: _JudgedOf) -> None:
        """Take the windows before one in which nothing came, behind the first in which something did."""
        if self._next is not None and window > self._next:
            for first, stop in judged(self._next, window):
                self.skip_to(first)
                self.take(first, stop - first, is_fine, begin_ns, None)
            if self._next < window:
                self.leave_out(window)

    def leave_out(self, window: int) -> None:
        """Let the windows before one be that are not judged."""
        self._in_a_row, self._next = 0, window

    def skip_to(self, window: int) -> None:
        """Let windows that are not known be between."""
        if self._next is not None and window != self._next:
            self._in_a_row = 0

    def break_off(self) -> None:
        """Let the numbers of windows begin anew, with 0."""
        self._in_a_row, self._next = 0, 0

    def take(
        self, window: int, count: int, is_fine: bool, begin_ns: int, frame: int | None, lost: int = 0
    ) -> None:  # fmt: skip
        """Take so many windows alike from one on; so many telegrams were lost in each."""
        self._next = window + count
        self.windows += count
        if is_fine:
            self._in_a_row = 0
            return
        before = self._in_a_row
        self._in_a_row += count
        self.longest_ns = max(self.longest_ns, self._in_a_row * self._length_ns)
        over = self._in_a_row - max(before, self._allowed)
        if over <= 0:
            return
        self.broken += over
        self.lost += max(lost, 0)
        if len(self.times_ns) < FRAMES_KEPT:
            self.times_ns.append(begin_ns + window * self._length_ns)
        if self.first_ns is None:
            self.first_ns = begin_ns + (window + count - self._in_a_row) * self._length_ns
        if frame is not None and len(self.frames) < FRAMES_KEPT:
            self.frames.append(frame)


def _compiled(text: str) -> Expression:
    names = {f"{_PREFIX}{one.name}": Named(TYPES.get(one.unit, FieldType.SIGNED)) for one in figures_of(Of.LIST)}
    try:
        return compile_expression(text, names)
    except UsageError as error:
        told = error.next_step
        if "--gvl" in told or not told:
            told = "with window, figures of a list are looked at, such as list.lost; without it, variables are"
        raise Unfit(error.what, expression=text, next_step=told, excerpt=error.excerpt) from None


def _column(name: str, measured: Sequence[Measured]) -> tuple[Column, Any]:
    figure = BY_NAME[name.removeprefix(_PREFIX)]
    values: list[Value] = [figure.read(one) for one in measured]
    known = np.array([one is not None for one in values], np.bool_)
    kind = TYPES.get(figure.unit, FieldType.SIGNED)
    if kind is FieldType.TEXT:
        texts = tuple(str(one or "") for one in values)
        return TextColumn(np.arange(len(texts)), texts), known
    dtype = np.float64 if kind is FieldType.REAL else np.int64
    return np.array([one or 0 for one in values], dtype), known
