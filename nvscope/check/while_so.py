"""While something is so: for each packet, whether rules that are judged only then look at it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.check.asked_rows import AskedRows
from nvscope.check.check import Setting
from nvscope.check.condition import Condition
from nvscope.check.so_spans import SoSpans
from nvscope.engine.told import Told

NEVER_SO = "when was never so"
TOO_SHORT_SO = "when was so for a shorter time than the rule needs"
NO_WHOLE_WINDOW = "when was so in no whole window"


class So(Struct, frozen=True):
    """When something was so in a batch.

    ``true`` has for each packet whether it was, by the last that is known up to it; ``since_ns`` since when, where it
    was. ``changes`` are the packets with which it began, or ended.
    """

    true: Bool
    since_ns: I64
    changes: I64

    def stretches(self) -> Iterator[tuple[int, int, bool]]:
        """Yield from which packet to before which one it was so, or was not, in their order."""
        bounds = [0, *(one for one in self.changes.tolist() if one), len(self.true)]
        for start, stop in pairwise(bounds):
            yield start, stop, bool(self.true[start])


class WhileSo:
    """Tells of an expression when it is so; variables in it hold their last value.

    ``ever`` tells whether it was so at any packet from ``since_ns`` on, ``spans`` when it was, behind or before.
    """

    def __init__(self, text: str, setting: Setting) -> None:
        self._condition = Condition(text, setting.fields)
        self._rows: AskedRows = setting.rows
        self._since_judged_ns = setting.since_ns
        self._told: Told | None = None
        self._so = _nothing()
        self._is_so, self._since_ns = False, 0
        self.ever = False
        self.spans = SoSpans()

    def see(self, told: Told) -> So:
        """Return what is so in a batch, which follows those seen before or is the last one."""
        if self._told is not told:
            self._told = told
            self._so = self._seen(told) if len(told) else _nothing()
            if any(one.everything for one in told.unheard):
                self._condition.forget()
                if self._is_so:
                    until_ns = max(one.until_ns for one in told.unheard)
                    end = np.array([until_ns]), np.array([told.first_frame + len(told)])
                    self.spans.note((end[0][:0], end[1][:0]), end)
                self._is_so = False
        return self._so

    def _seen(self, told: Told) -> So:
        asked = self._rows.of(told, self._condition.lists)
        latest_ns = self._rows.latest_ns(told)
        state = np.full(len(told) + 1, -1, np.int8)
        state[0] = self._is_so
        if len(asked):
            with np.errstate(all="ignore"):
                state[asked.frame - told.first_frame + 1] = self._condition.told(asked)[0]
        place = np.maximum.accumulate(np.where(state >= 0, np.arange(len(state)), 0))
        true = state[place] == 1
        changes = np.flatnonzero(true[1:] != true[:-1])
        true = true[1:]
        begins = changes[true[changes]]
        last = np.searchsorted(begins, np.arange(len(true)), side="right") - 1
        since_ns = np.where(last >= 0, latest_ns[begins[last]] if len(begins) else 0, self._since_ns)
        ends = changes[~true[changes]]
        if len(changes):
            self.spans.note(*((latest_ns[one], one + told.first_frame) for one in (begins, ends)))
        self._is_so, self._since_ns = bool(true[-1]), int(since_ns[-1])
        judged = true if self._since_judged_ns is None else true & (latest_ns >= self._since_judged_ns)
        self.ever = self.ever or bool(judged.any())
        return So(true, since_ns, changes)


def _nothing() -> So:
    return So(np.zeros(0, np.bool_), np.zeros(0, np.int64), np.zeros(0, np.int64))


def while_so(setting: Setting) -> WhileSo | None:
    """Return what tells when a rule is judged, one for all rules that say it alike; None where it always is."""
    if not setting.when:
        return None
    return setting.shared(("when", setting.when), lambda: WhileSo(setting.when, setting))
