"""Where an expression becomes true: of each stream by itself, whatever the batches."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64
from nvscope.engine.runs import stable_order
from nvscope.engine.telegram_streams import TelegramStreams
from nvscope.engine.told import Told
from nvscope.view.display_filter import PacketChoice
from nvscope.view.moment_filter import MomentFilter
from nvscope.view.rows.frames import FrameRows


class Edges:
    """Finds the frames at which a filter becomes true that was not true of the frame before.

    That is the one before of the same stream, what is no telegram being one together; where the filter asks for what
    is of a bus, the one before on that, and where it looks at variables of several lists, the one before of all.
    """

    def __init__(self, chosen: MomentFilter) -> None:
        self._chosen = chosen
        self._choice = None if chosen.alone is None else PacketChoice(chosen.alone)
        self._streams = TelegramStreams(by_bus=chosen.by_bus)
        self._last = np.zeros(1, np.bool_)

    def rows(self, told: Told) -> I64:
        """Return the rows of a batch at which it becomes true, rising."""
        asked = told.wanted
        if not len(asked):
            return asked
        stream = self._streams.of(told, asked)
        if self._choice is not None:
            true = self._choice(told)[asked]
        else:
            true = self._chosen.in_order(FrameRows.of(told, asked), stream)
        if not self._chosen.by_stream:
            stream = np.zeros(len(asked), np.int64)
        self._last = np.append(self._last, np.zeros(max(len(self._streams) - len(self._last), 0), np.bool_))
        order = stable_order(stream, len(self._last))
        stream, true = stream[order], true[order]
        first = np.flatnonzero(np.diff(stream, prepend=-1))
        before = np.append(False, true[:-1])
        before[first] = self._last[stream[first]]
        last = np.append(first[1:], len(stream)) - 1
        self._last[stream[last]] = true[last]
        return np.sort(asked[order[true & ~before]])
