"""``.mf4`` files (ASAM MDF 4, also those a logger did not finish), read by asammdf in a process of its own.

A file that ends that process is damaged, and told so; so is one for which it takes too much memory. Times are in UTC.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import IO

import numpy as np

from dissectors.batch import U8, Direction, PacketBatch, Records
from dissectors.can.frame import FD_LENGTHS
from nvscope.capture.can import error_frame, mdf_child
from nvscope.capture.can.channel_names import ChannelNames
from nvscope.capture.can.frame import (
    BIT_RATE_SWITCH,
    ERROR_STATE,
    EXTENDED,
    FD_FRAME,
    FD_WORDS,
    HEAD_BYTES,
    MAX_DATA_BYTES,
    REMOTE,
    STANDARD_IDENTIFIER,
    CanRows,
    FrameBatches,
)
from nvscope.capture.can.mdf_child import HEAD, KINDS, RECORD
from nvscope.capture.can.on_disk import on_disk
from nvscope.capture.content import Content
from nvscope.capture.reader import Reader, ReadingSizes
from nvscope.capture.source import Truncation
from nvscope.capture.time_span import TIME_LIMIT_NS
from nvscope.extras import require

_LARGEST_BLOCK_BYTES = 64 << 20
_MAX_DLC = 15
_DATA, _ERROR, _REMOTE = range(len(KINDS))
_LENGTHS = np.array(FD_LENGTHS, np.int64)


class _Damaged(Exception):
    """What the child says, or how it ended."""


class MdfReader(Reader):
    """Reads the CAN frames of one MDF file."""

    def __init__(self, content: Content, sizes: ReadingSizes) -> None:
        super().__init__(content, sizes)
        require("reading an MDF 4 log needs", "asammdf", path=content.path)
        self._path = content.disk_path
        self._pieces = iter(()) if self._path else content.pieces()
        self._names = ChannelNames(self.channels)
        self._left_out = 0
        self._first_fault = ""

    def batches(self) -> Iterator[PacketBatch]:
        """Yield the frames of all channel groups by time."""
        batches = FrameBatches(self.sizes.batch_packets)
        damage = ""
        with on_disk(self._path, self._pieces) as path, _child(path) as child:
            try:
                for records in _blocks(child):
                    rows = self._rows(records)
                    self.progress.frames += len(rows)
                    yield from batches.add(rows)
            except _Damaged as error:
                damage = str(error)
        if batches.rows:
            yield batches.take()
        if self._path:
            self.position = self.content.size_bytes or 0
        if damage:
            self._first_fault = f"damaged: {damage}; nothing after it can be read"
        elif self._left_out:
            self._first_fault += f"; {self._left_out} such frames are left out" if self._left_out > 1 else ""
        if self._first_fault:
            self.progress.left_out = self._first_fault
            self.progress.truncation = Truncation(self.position, self._first_fault)

    def _rows(self, told: Records) -> CanRows:
        """Return the frames of some records; those that cannot be are left out."""
        error, remote = told["kind"] == _ERROR, told["kind"] == _REMOTE
        wide = (told["extended"] == 0) & (told["identifier"] > STANDARD_IDENTIFIER) & ~error
        late = (told["ts_ns"] > TIME_LIMIT_NS) | (told["ts_ns"] < -TIME_LIMIT_NS)
        beyond = (told["dlc"] > _MAX_DLC) & ~error
        for wrong, what in (
            (wide, "an identifier of more than 11 bits"),
            (late, "a time after 2116"),
            (beyond, "a data length code above 15"),
        ):
            if wrong.any():
                self._first_fault = self._first_fault or what
        good = ~(wide | late | beyond)
        if not good.all():
            self._left_out += int((~good).sum())
            told, error, remote = told[good], error[good], remote[good]
        fd = (told["fd"] != 0) & ~error & ~remote
        fd |= (told["kind"] == _DATA) & (told["held"] > MAX_DATA_BYTES)
        code = np.minimum(told["dlc"], _MAX_DLC).astype(np.int64)
        length = np.where(fd, _LENGTHS[code], np.minimum(code, MAX_DATA_BYTES))
        held = np.where(remote, 0, np.minimum(told["held"], length))
        raw_dlc = np.where(~fd & (code > MAX_DATA_BYTES), code, 0)
        word = told["identifier"] | np.where(told["extended"] != 0, EXTENDED, 0).astype(np.uint32)
        word |= np.where(remote, REMOTE, 0).astype(np.uint32)
        flags = np.where(told["brs"] != 0, BIT_RATE_SWITCH, 0) | np.where(told["esi"] != 0, ERROR_STATE, 0)
        flags = np.where(fd, flags | FD_FRAME, 0)
        frames = np.zeros((len(told), 4 * FD_WORDS), np.uint8)
        frames[:, HEAD_BYTES:] = np.where(np.arange(64) < held[:, np.newaxis], told["data"], 0)
        frames[:, 4], frames[:, 5], frames[:, 7] = length, flags, raw_dlc
        for place in np.flatnonzero(error).tolist():
            found = error_frame.of_mdf(int(told["dlc"][place]))
            word[place] = found.identifier
            frames[place, 4:16] = np.frombuffer(bytes([len(found.data), 0, 0, 0]) + found.data, np.uint8)
            length[place] = held[place] = len(found.data)
        frames[:, :4] = word.astype(">u4").view(np.uint8).reshape(-1, 4)
        numbers, which = np.unique(told["channel"], return_inverse=True)
        channel = np.array([self._names.number(None if one < 0 else one) for one in numbers.tolist()], np.uint16)
        return CanRows(
            frames.view(np.uint32),
            (held + HEAD_BYTES).astype(np.int32),
            np.where(remote, HEAD_BYTES, length + HEAD_BYTES).astype(np.int64),
            told["ts_ns"].astype(np.int64),
            channel[which],
            _directions(told["direction"]),
        )


def _directions(told: Records) -> U8:
    way: U8 = np.select([told == 0, told == 1], [Direction.RX, Direction.TX], Direction.UNKNOWN).astype(np.uint8)
    return way


@contextmanager
def _child(path: str) -> Generator[subprocess.Popen[bytes], None, None]:
    """Run the child; it is ended where nobody wants what it still has."""
    with tempfile.TemporaryDirectory(prefix="nvscope-") as directory:
        # asammdf puts copies of what is unfinished into the directory for temporary files, and may not tidy up.
        child = subprocess.Popen(
            [sys.executable, "-P", mdf_child.__file__, path],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "TMPDIR": directory, "TEMP": directory, "TMP": directory},
        )
        try:
            yield child
        finally:
            child.kill()
            if child.stdout is not None:
                child.stdout.close()
            child.wait()


def _blocks(child: subprocess.Popen[bytes]) -> Iterator[Records]:
    """Yield the records that a child writes; raises _Damaged where it does not come to its end."""
    assert child.stdout is not None
    while True:
        head = _take(child.stdout, HEAD.size)
        if len(head) < HEAD.size:
            raise _Damaged(_ending(child.wait()))
        kind, size = HEAD.unpack(head)
        if kind == mdf_child.DONE:
            return
        content = _take(child.stdout, min(size, _LARGEST_BLOCK_BYTES))
        if kind == mdf_child.FAILED:
            raise _Damaged(content.decode("utf-8", "replace"))
        if len(content) < size:
            raise _Damaged(_ending(child.wait()))
        yield np.frombuffer(content, RECORD)


def _take(file: IO[bytes], count: int) -> bytes:
    parts = bytearray()
    while len(parts) < count and (part := file.read(count - len(parts))):
        parts += part
    return bytes(parts)


def _ending(code: int) -> str:
    """Return how a process ended that should not have."""
    if code < 0:
        try:
            return f"reading it ended asammdf by {signal.Signals(-code).name}"
        except ValueError:
            return f"reading it ended asammdf by signal {-code}"
    return f"reading it ended asammdf with code {code}"
