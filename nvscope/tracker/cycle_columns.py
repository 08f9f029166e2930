"""What is kept of a sender's list over several SubIndexes, and of each of its streams, to tell its cycles."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U16, U64, Bool
from nvscope.engine.keyed_columns import KeyedColumns

NEVER = np.iinfo(np.int64).max


class PairColumns(KeyedColumns):
    """One row a sender and list: the telegram before, and the open cycle.

    ``active_from`` is the frame from which the pair has several SubIndexes; ``size`` is 0 before the first cycle,
    ``last_frame`` is that of its last telegram. ``seen`` are the streams of the pair, ``known`` the bits of their
    SubIndexes; from frame ``known_from`` on, all of them had come. ``ready`` are those whose interval is known, all
    from frame ``ready_from`` on; of what was unheard, it has to be known anew.
    ``partial``: the open cycle may have begun before the capture. ``skew_ns`` is the longest time between the first and
    the last telegram of a cycle. ``present`` are bits of the SubIndexes in the open one, where somebody listens.
    """

    streams: I64
    active_from: I64
    counter: U16
    subindex: I64
    last_ns: I64
    size: I64
    begin_ns: I64
    begin_frame: I64
    partial: Bool
    skew_ns: I64
    present: U64
    last_frame: I64
    seen: I64
    known: U64
    known_from: I64
    ready: I64
    ready_from: I64
    COLUMNS: ClassVar = {
        "streams": (np.int64(0), 1),
        "active_from": (np.int64(NEVER), 1),
        "counter": (np.uint16(0), 1),
        "subindex": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "size": (np.int64(0), 1),
        "begin_ns": (np.int64(0), 1),
        "begin_frame": (np.int64(0), 1),
        "partial": (np.False_, 1),
        "skew_ns": (np.int64(0), 1),
        "present": (np.uint64(0), 1),
        "last_frame": (np.int64(0), 1),
        "seen": (np.int64(0), 1),
        "known": (np.uint64(0), 1),
        "known_from": (np.int64(0), 1),
        "ready": (np.int64(0), 1),
        "ready_from": (np.int64(0), 1),
    }


class StreamPairs(KeyedColumns):
    """One row a stream: its pair, -1 of one that is not looked at, its first frame, and its SubIndex.

    ``ready_from`` is the frame from which its interval is known.
    """

    pair: I64
    first_frame: I64
    subindex: I64
    ready_from: I64
    COLUMNS: ClassVar = {
        "pair": (np.int64(-1), 1),
        "first_frame": (np.int64(0), 1),
        "subindex": (np.int64(0), 1),
        "ready_from": (np.int64(NEVER), 1),
    }
