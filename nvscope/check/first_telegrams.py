"""The first telegram of each stream that is judged, so that a verdict about who sends can show one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from dissectors.batch import I64
from nvscope.check.check import Setting
from nvscope.check.while_so import WhileSo, while_so
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.told import Told


class FirstTelegrams:
    """An observer that keeps each stream's first telegram from ``since_ns`` on, None for all, while it ``holds``."""

    by_stream: ClassVar[bool] = True

    def __init__(self, since_ns: int | None = None, holds: WhileSo | None = None) -> None:
        self._since_ns, self.holds = since_ns, holds
        self._streams = _FirstColumns()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        so = None if self.holds is None else self.holds.see(told)
        if not len(told):
            return
        self._streams.resize(len(told.keys.streams))
        frame, first_ns = self._streams.column("frame"), self._streams.column("first_ns")
        for rows in (told.laid.data, told.laid.pdos):
            if not len(rows):
                continue
            new = np.flatnonzero(frame[rows.run_stream] == 0)
            if not len(new):
                continue
            first = rows.start[new]
            if self._since_ns is not None or so is not None:
                judged = np.ones(len(rows), np.bool_) if so is None else so.true[rows.packet]
                if self._since_ns is not None:
                    judged &= rows.time_ns >= self._since_ns
                known = np.append(np.flatnonzero(judged), len(rows))
                first = known[np.searchsorted(known, first)]
                came = first < rows.stop[new]
                new, first = new[came], first[came]
            stream = rows.run_stream[new]
            frame[stream] = rows.packet[first] + told.first_frame
            first_ns[stream] = rows.time_ns[first]

    def of(self, stream: int) -> tuple[int, int] | None:
        """Return when that of a stream came, and its frame; None where none has come."""
        if stream >= len(self._streams) or not self._streams.frame[stream]:
            return None
        return int(self._streams.first_ns[stream]), int(self._streams.frame[stream])


class _FirstColumns(KeyedColumns):
    """One row a stream: the number of a frame, 0 for none, and its time."""

    frame: I64
    first_ns: I64
    COLUMNS: ClassVar = {"frame": (np.int64(0), 1), "first_ns": (np.int64(0), 1)}


def watch_first(setting: Setting, told: Mapping[str, Any]) -> FirstTelegrams | None:
    """Return what watches at times only; what came first at any time is known for all rules."""
    holds = while_so(setting)
    if holds is None:
        return None
    return setting.shared(("first", setting.when), lambda: FirstTelegrams(setting.since_ns, holds))
