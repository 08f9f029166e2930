"""A recording as one file after the other, as of tshark's ``-b``: where one ends, its name, which stay."""

from __future__ import annotations

import os
import time
from collections import deque
from contextlib import suppress

import numpy as np
from msgspec import Struct

from dissectors.batch import PacketBatch

_RECORD_BYTES = 32
"""What a packet takes in a file beside its bytes, in pcapng; in pcap it is half of that."""


class FileRule(Struct, frozen=True):
    """When a file is followed by another one; None for never.

    ``duration_ns`` is between the times of its packets, ``size_bytes`` that of the file: the packet that goes beyond it
    is the last one. Of more than ``files``, the oldest is removed.
    """

    duration_ns: int | None = None
    packets: int | None = None
    size_bytes: int | None = None
    files: int | None = None


class FileSeries:
    """The files of a recording: ``path`` itself where no rule asks for another one, else numbered ones beside it."""

    def __init__(self, path: str, rule: FileRule) -> None:
        self._stem, self._suffix = os.path.splitext(path)
        self._path, self._rule = path, rule
        self._there: deque[str] = deque()
        self._packets = 0
        self._first_ns: int | None = None
        self.begun = 0
        """How many files there were so far."""

    @property
    def _is_one(self) -> bool:
        rule = self._rule
        return rule.duration_ns is None and rule.packets is None and rule.size_bytes is None

    def next_path(self) -> str:
        """Return what the next file is called: ``name_00001_20260131080001.pcapng``, as tshark's."""
        self.begun += 1
        self._packets, self._first_ns = 0, None
        if self._is_one:
            return self._path
        return f"{self._stem}_{self.begun:05}_{time.strftime('%Y%m%d%H%M%S')}{self._suffix}"

    def is_there(self, path: str) -> None:
        """Take that a file was begun, and remove the oldest one where there are too many."""
        self._there.append(path)
        while self._rule.files is not None and len(self._there) > self._rule.files:
            with suppress(OSError):  # somebody else has taken it away
                os.remove(self._there.popleft())

    def room_for(self, batch: PacketBatch, size_bytes: int) -> int:
        """Return how many of some packets the file still takes, which is so large; all where there is no limit."""
        if not len(batch):
            return 0
        rule, rows = self._rule, len(batch)
        if rule.packets is not None:
            rows = min(rows, rule.packets - self._packets)
        if rule.duration_ns is not None:
            first_ns = int(batch.ts_ns[0]) if self._first_ns is None else self._first_ns
            late = np.flatnonzero(batch.ts_ns - first_ns >= rule.duration_ns)
            rows = min(rows, int(late[0]) if len(late) else rows)
        if rule.size_bytes is not None:
            room = rule.size_bytes - size_bytes
            behind = np.cumsum(batch.captured.astype(np.int64) + _RECORD_BYTES)
            rows = min(rows, int(np.searchsorted(behind, room)) + 1) if room > 0 else 0
        # However small it is to be, one packet is in each.
        return max(rows, 0) if self._packets else max(rows, 1)

    def take(self, batch: PacketBatch) -> None:
        """Take that packets were written to the file."""
        if self._first_ns is None:
            self._first_ns = int(batch.ts_ns[0])
        self._packets += len(batch)
