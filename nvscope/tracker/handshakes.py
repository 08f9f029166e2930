"""Handshakes: whether connections are opened, as the capture has it, behind what answers that."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.headers import ACK, SYN
from nvscope.engine.runs import runs_of
from nvscope.tracker.pieces import NEVER
from nvscope.tracker.segments import WRAP, Segments, StreamColumns
from nvscope.tracker.segments_aside import NEAR


def opened_late(rows: Segments, carrying: Bool, streams: StreamColumns) -> int:
    """Return the first frame with which a direction begins that was acknowledged before, ``NEVER`` without one.

    That is a SYN, the first thing of this direction of these ends that was captured, where the last segment of the
    other direction, since something of that was, acknowledges what follows on it. The columns ``heard`` and ``said`` go
    on by these segments.
    """
    start, stop = runs_of(rows.stream)
    of_run = rows.stream[start]
    if streams.heard[of_run].all() and streams.heard[of_run ^ 1].all():
        return NEVER
    new = np.flatnonzero(carrying & ~streams.heard[rows.stream])[::-1]
    first = np.where(streams.heard, -1, len(rows))
    first[rows.stream[new]] = new  # assigned backwards, so that the first one of each stream stays
    told = np.where(((rows.flags & ACK) != 0) & (rows.acknowledgement > 0), rows.acknowledgement, -1)
    row = first[of_run[~streams.heard[of_run]]]
    row = row[row < len(rows)]
    row = row[(rows.flags[row] & SYN) != 0]
    partner = rows.stream[row] ^ 1
    before = _rows_before(rows, partner, rows.frame[row])
    is_here = (before >= 0) & (before >= first[partner])
    said = np.where(is_here, told[before], streams.said[partner])
    late = (said >= 0) & ((said - rows.sequence[row] - 1) % WRAP <= NEAR)
    streams.heard[rows.stream[new]] = True
    alone = ~streams.heard[of_run ^ 1] & streams.heard[of_run]
    streams.said[of_run[alone]] = told[stop[alone] - 1]
    return int(rows.frame[row[late]].min(initial=NEVER))


def _rows_before(rows: Segments, stream: I64, frame: I64) -> I64:
    """Return the last row of each of some streams in front of a frame, -1 without one."""
    first = int(rows.frame.min())
    span = int(rows.frame.max()) - first + 1
    found = (rows.stream * span + rows.frame - first).searchsorted(stream * span + frame - first) - 1
    return np.where((found >= 0) & (rows.stream[found] == stream), found, -1)
