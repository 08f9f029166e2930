"""NodeColumns: what is kept of each CANopen node."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.tracker.can.majority import NEVER

NO_STATE = -1


class NodeColumns(KeyedColumns):
    """One row a channel and node; node 0 has the commands to all. Frame numbers are 0, states -1 where there are none.

    ``heard``: there was a heartbeat since somebody listens, which tells ``state``; ``command`` has been the last one
    since then, and is known where ``command_frame`` is not 0. ``emergency`` are the eight bytes of the last one, as a
    number, the first byte lowest. ``strays`` are the frames behind the first heartbeat, of its COB-ID, that are none.
    The last three are the frames in which a heartbeat and a command came first, and with which heartbeats ceased to be
    evidence; else ``NEVER``.
    """

    heard: Bool
    heartbeats: I64
    strays: I64
    boot_ups: I64
    changes: I64
    state: I64
    since_ns: I64
    last_ns: I64
    emergencies: I64
    emergency: U64
    emergency_ns: I64
    commands: I64
    command: I64
    command_ns: I64
    command_frame: I64
    beats_from: I64
    told_from: I64
    doubted_from: I64
    COLUMNS: ClassVar = {
        "heard": (np.False_, 1),
        "heartbeats": (np.int64(0), 1),
        "strays": (np.int64(0), 1),
        "boot_ups": (np.int64(0), 1),
        "changes": (np.int64(0), 1),
        "state": (np.int64(NO_STATE), 1),
        "since_ns": (np.int64(0), 1),
        "last_ns": (np.int64(0), 1),
        "emergencies": (np.int64(0), 1),
        "emergency": (np.uint64(0), 1),
        "emergency_ns": (np.int64(0), 1),
        "commands": (np.int64(0), 1),
        "command": (np.int64(0), 1),
        "command_ns": (np.int64(0), 1),
        "command_frame": (np.int64(0), 1),
        "beats_from": (np.int64(NEVER), 1),
        "told_from": (np.int64(NEVER), 1),
        "doubted_from": (np.int64(NEVER), 1),
    }
