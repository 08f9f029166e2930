"""Figures of lists, window by window: whether an expression over them is what it should be."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from nvscope.check.check import Evidence, Setting
from nvscope.check.lists import CalledLists
from nvscope.check.parameters import Unfit
from nvscope.check.verdict import Judged, Verdict
from nvscope.engine.told import Told
from nvscope.errors import UsageError
from nvscope.expression.expression import compile_expression
from nvscope.expression.typed_columns import Column, FieldType, Named, TextColumn
from nvscope.list_key import ListKey
from nvscope.tracker.figures import BY_NAME, Of, Value, figures_of
from nvscope.tracker.measured import Measured
from nvscope.tracker.subjects import subjects
from nvscope.tracker.windows import Window, Windows
from nvscope.units import count_of
from nvscope.view.fields.verdicts import TYPES

_SECOND_NS = 1_000_000_000
_PREFIX = "list."


class FigureWindows:
    """An observer of the figures of each list in windows, end to end; an incomplete last one is left out.

    An expression over them is ``wanted`` to be true, or false, of each window; where it is not, for no longer than
    ``limit_ns``. It has to be run on the source that ``windows`` cut.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, setting: Setting, text: str, length_ns: int, limit_ns: int, *, wanted: bool) -> None:
        names = {f"{_PREFIX}{one.name}": Named(TYPES.get(one.unit, FieldType.SIGNED)) for one in figures_of(Of.LIST)}
        if setting.when:
            raise Unfit(
                "figures of windows are not judged only at times", "when", next_step="leave when, or window, out"
            )
        try:
            self._expression = compile_expression(text, names)
        except UsageError as error:
            raise Unfit(error.what, expression=text, next_step=error.next_step, excerpt=error.excerpt) from None
        self.windows = Windows(length_ns, setting.since_ns)
        self._setting, self._wanted = setting, wanted
        self._length_ns, self._limit_ns = length_ns, limit_ns
        self._lists: dict[ListKey, _Run] = {}
        self._holes: list[tuple[int, int | None]] = []
        """Since when nobody listened, and until when; None: still."""

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told) and self._holes and self._holes[-1][1] is None:
            self._holes[-1] = self._holes[-1][0], int(told.batch.packets.ts_ns.min())
        self.windows.observe(told)
        for window in self.windows.closed():
            if not any(
                since < window.end_ns and (until is None or window.start_ns < until) for since, until in self._holes
            ):
                self._take(window)
        self._holes += [(one.until_ns, None) for one in told.unheard if one.everything]

    def _take(self, window: Window) -> None:
        summary = window.counted.summary(intervals_ns=self._setting.nominal_ns)
        keys = {one.number: one.key for one in summary.lists} | {one.number: one.key for one in summary.can.lists}
        own = [one for one in subjects(summary) if one.of is Of.LIST and one.list is not None]
        wanted, _ = CalledLists(keys.values(), self._setting.names).chosen(self._setting.lists)
        known = set(wanted)
        own = [one for one in own if keys[one.list] in known]  # type: ignore[index]
        if not own:
            return
        measured = [one.measured for one in own]
        true, is_known = self._expression.told(lambda name: _column(name, measured))
        for place, subject in enumerate(own):
            if is_known is not None and not is_known[place]:
                continue
            assert subject.list is not None
            run = self._lists.setdefault(keys[subject.list], _Run())
            run.take(window, bool(true[place]) == self._wanted, self._length_ns, self._limit_ns)

    def judged(self, known: Evidence, lists: Collection[ListKey]) -> Iterator[Judged]:
        """Yield a verdict for each list that came; what is below the limit is not told."""
        limit = self._limit_ns / _SECOND_NS
        for key in sorted(lists):
            run = self._lists.get(key)
            if run is None:
                yield Judged(Verdict.INCONCLUSIVE, key, reason="no whole window of it is there", limit=limit, unit="s")
                continue
            verdict = Verdict.FAIL if run.broken else Verdict.PASS
            reason = f"{run.broken} of {count_of(run.windows, 'window')}" if run.broken else ""
            if run.broken and run.broken <= known.drops:
                verdict = Verdict.INCONCLUSIVE
                reason = f"the capture itself lost {count_of(known.drops, 'frame')}: it may have been these"
            yield Judged(
                verdict, key, reason=reason, worst=run.longest_ns / _SECOND_NS, limit=limit, unit="s",
                count=run.broken, first_ns=run.first_ns,
            )  # fmt: skip


class _Run:
    """The windows of one list: how many were otherwise than wanted, and the longest time of such ones in a row."""

    def __init__(self) -> None:
        self.windows = self.broken = 0
        self.longest_ns = 0
        self.first_ns: int | None = None
        self._in_a_row = 0
        self._number = -1

    def take(self, window: Window, is_fine: bool, length_ns: int, limit_ns: int) -> None:
        self.windows += 1
        if is_fine or window.number != self._number + 1:
            self._in_a_row = 0
        self._number = window.number
        if is_fine:
            return
        self._in_a_row += 1
        self.longest_ns = max(self.longest_ns, self._in_a_row * length_ns)
        if self._in_a_row * length_ns > limit_ns:
            self.broken += 1
            begin_ns = window.end_ns - self._in_a_row * length_ns
            self.first_ns = begin_ns if self.first_ns is None else self.first_ns


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
