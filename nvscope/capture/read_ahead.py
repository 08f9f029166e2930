"""Large files read ahead by a second process: one core finds where the packets are, another one looks at them.

The process is a copy of this one, with the same map of the same file and the same reader, in the middle of its work. It
goes on from there, and hands over columns, not bytes: where each packet lies, how long it is, and when it came::

    copy           finds packets → columns into a free slot of shared memory → a message on what is in it, how far it is
    this process   message → columns out of the slot → the slot is free → a batch over its own map of the file

What comes out is what the reader here would have made. Whatever befalls the copy, its reader is still here, and reads
on from where the copy was made, without what has been passed on already.
"""

from __future__ import annotations

import gc
import mmap
import os
import pickle
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from typing import IO, Any, Never

import numpy as np
from msgspec import Struct

from dissectors.batch import U8, U16, PacketBatch
from nvscope.capture.byte_window import MappedWindow
from nvscope.capture.reader import Progress, WindowReader

_SLOTS = 3
# Of offset, original, ts_ns, captured: the wide ones first, so that all are aligned.
_COLUMNS = tuple(np.dtype(kind) for kind in (np.int64, np.int64, np.int64, np.int32))
_ROW_BYTES = sum(column.itemsize for column in _COLUMNS)
_FREE = b"\0"


class _Message(Struct, frozen=True):
    """What the copy says: ``rows`` packets are in the next slot, and it has come so far; or, without, that it ended.

    ``data`` is what the packets lie in where that is not the map. ``link`` is one number where all share it.
    """

    rows: int
    position: int
    progress: dict[str, Any]
    channels: list[str]
    data: U8 | None = None
    link: int | U16 = 0
    channel: U16 | None = None
    direction: U8 | None = None


def batches_of(reader: WindowReader) -> Iterator[PacketBatch]:
    """Yield what ``reader.batches()`` does, made by a second process where that is possible and worth it.

    The first batch is made here: who wants no more is not kept waiting for a process.
    """
    batches = reader.batches()
    first = next(batches, None)
    if first is None:
        return
    yield first
    window = reader.content.window()
    if isinstance(window, MappedWindow) and is_worth_it(window.size - reader.position, reader.sizes.ahead_bytes):
        yield from made_by_a_copy(reader, batches, window)
    else:
        yield from batches


def is_worth_it(rest_bytes: int, ahead_bytes: int) -> bool:
    """Tell whether so much is to be read that a process for it pays, and whether it can be had.

    A process with several threads cannot be copied safely, and on one core there is nothing to be won.
    """
    if rest_bytes < ahead_bytes or sys.platform != "linux":
        return False
    return threading.active_count() == 1 and len(os.sched_getaffinity(0)) > 1


def made_by_a_copy(reader: WindowReader, batches: Iterator[PacketBatch], window: MappedWindow) -> Iterator[PacketBatch]:
    """Yield the rest of ``batches``, which are those of ``reader`` over ``window``, made by a copy of this process."""
    capacity = reader.sizes.batch_packets
    slots = mmap.mmap(-1, _SLOTS * capacity * _ROW_BYTES)
    told, tells = os.pipe()
    wait, free = os.pipe()
    # Both have come equally far; what the copy finds is put in here, and taken back if it fails.
    begin = _state(reader, Progress(), [])
    try:
        copy = os.fork()
    except OSError:  # no more processes, no memory
        copy = -1
    if copy == 0:
        os.close(told)
        os.close(free)
        _make(reader, batches, window, slots, tells, wait)
    os.close(tells)
    os.close(wait)
    done = 0
    ended = False
    try:
        with open(told, "rb") as messages, open(free, "wb", buffering=0) as freed:
            for slot in _in_turn():
                message = _next_message(messages)
                if message is None:
                    break
                _set_state(reader, message)
                ended = not message.rows
                if ended:
                    break
                batch = _taken(message, slots, slot, window.data, capacity)
                with suppress(OSError):  # it has gone, which the next message says
                    freed.write(_FREE)
                done += message.rows
                yield batch
                window.release(message.position)
    finally:
        if copy > 0:
            with suppress(ProcessLookupError):
                os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)
    if not ended:
        _set_state(reader, begin, anew=True)
        yield from _without_first(batches, done)


def _make(
    reader: WindowReader, batches: Iterator[PacketBatch], window: MappedWindow, slots: mmap.mmap, tells: int, wait: int
) -> Never:
    """Put batches into the slots and tell of them, until the end, or until nobody waits for them; in the copy."""
    try:
        # Keys go to both processes; what a signal means is for the other one to say. Of what was garbage when the copy
        # was made, nothing is to be closed twice.
        gc.disable()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for name in (signal.SIGBUS, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
            signal.signal(name, signal.SIG_DFL)
        known, channels = Progress(comments=list(reader.progress.comments)), list(reader.channels)
        capacity = reader.sizes.batch_packets
        with open(tells, "wb") as messages, open(wait, "rb", buffering=0) as freed:
            for number, (slot, batch) in enumerate(zip(_in_turn(), _not_empty(batches), strict=False)):
                if number >= _SLOTS and not freed.read(len(_FREE)):
                    break
                columns = batch.offset, batch.original, batch.ts_ns, batch.captured
                for own, column in zip(_columns(slots, slot, capacity), columns, strict=True):
                    own[: len(batch)] = column
                link = batch.single_link
                state = _state(reader, known, channels)
                message = _Message(
                    len(batch), reader.position, state.progress, state.channels,
                    None if batch.data is window.data else batch.data,
                    batch.link if link is None else link, batch.channel, batch.direction,
                )  # fmt: skip
                known, channels = Progress(comments=list(reader.progress.comments)), list(reader.channels)
                pickle.dump(message, messages, pickle.HIGHEST_PROTOCOL)
                messages.flush()
            else:
                pickle.dump(_state(reader, known, channels), messages, pickle.HIGHEST_PROTOCOL)
                messages.flush()
    finally:
        # As little as that: no buffers written again, no temporary files removed.
        os._exit(0)


def _in_turn() -> Iterator[int]:
    while True:
        yield from range(_SLOTS)


def _not_empty(batches: Iterator[PacketBatch]) -> Iterator[PacketBatch]:
    return (batch for batch in batches if len(batch))


def _columns(slots: mmap.mmap, slot: int, capacity: int) -> list[Any]:
    """Return the columns of a slot, in the order of ``_COLUMNS``."""
    columns, at = [], slot * capacity * _ROW_BYTES
    for kind in _COLUMNS:
        columns.append(np.frombuffer(slots, kind, capacity, at))
        at += capacity * kind.itemsize
    return columns


def _taken(message: _Message, slots: mmap.mmap, slot: int, data: U8, capacity: int) -> PacketBatch:
    """Return the batch of a message: its columns are copies, for they are not valid for the next batch only."""
    offset, original, ts_ns, captured = (column[: message.rows].copy() for column in _columns(slots, slot, capacity))
    link = message.link
    return PacketBatch(
        data if message.data is None else message.data, offset, captured, original, ts_ns,
        PacketBatch.link_column(link, message.rows) if isinstance(link, int) else link, message.channel,
        direction=message.direction,
    )  # fmt: skip


def _state(reader: WindowReader, known: Progress, channels: list[str]) -> _Message:
    """Return how far a reader is; of comments and channels, those behind the ones that are known."""
    progress = {name: getattr(reader.progress, name) for name in _progress_names()}
    progress["comments"] = reader.progress.comments[len(known.comments) :]
    return _Message(0, reader.position, progress, reader.channels[len(channels) :])


def _set_state(reader: WindowReader, message: _Message, *, anew: bool = False) -> None:
    """Let a reader be as far as a message says, which goes on from the state before, or says all ``anew``."""
    reader.position = message.position
    for name in _progress_names():
        if name != "comments":
            setattr(reader.progress, name, message.progress[name])
    if anew:
        reader.progress.comments.clear()
        reader.channels.clear()
    reader.progress.comments.extend(message.progress["comments"])
    reader.channels.extend(message.channels)


def _progress_names() -> list[str]:
    # When the first and the last packet came is noted where batches are passed on.
    return [name for name in Progress.__struct_fields__ if name not in ("start_ns", "end_ns")]


def _next_message(messages: IO[bytes]) -> _Message | None:
    """Return what the copy says next, None where it ended without a word."""
    try:
        message: _Message = pickle.load(messages)  # from a copy of this process, through its own pipe
    except (EOFError, OSError, pickle.UnpicklingError):
        return None
    return message


def _without_first(batches: Iterator[PacketBatch], rows: int) -> Iterator[PacketBatch]:
    """Yield batches without so many of their first packets."""
    for batch in batches:
        if len(batch) > rows:
            yield batch[rows:] if rows else batch
        rows = max(rows - len(batch), 0)
