"""Large files read ahead by a second process: one core finds where the packets are, another one looks at them.

The process is a copy of this one, with the same map of the same file and the same reader, in the middle of its work. It
goes on from there, and hands over columns, not bytes: where each packet lies, how long it is, and when it came; and
what it has done with the packets already, where somebody has work for it (``nvscope.capture.source.AheadWork``)::

    copy           finds packets → works → what comes of it into a free slot of shared memory, and how far it is
    this process   takes it out of the slot → the slot is free → a batch over its own map of the file

What comes out is what the reader here would have made. Whatever befalls the copy, its reader is still here, and reads
on from where the copy was made, without what has been passed on already.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain
from typing import Any, Never, TypeGuard

from msgspec import Struct

from dissectors.batch import PacketBatch
from nvscope.capture.byte_window import ByteWindow, MappedWindow
from nvscope.capture.reader import Progress, WindowReader
from nvscope.capture.slots import Slots
from nvscope.capture.source import AheadWork, Done

_FEW = 1 << 13
"""So many packets are told by this process before there is another one that has work to do with the others."""


class _State(Struct, frozen=True):
    """How far a reader is; ``ends``: nothing comes behind it."""

    position: int
    progress: dict[str, Any]
    channels: list[str]
    ends: bool = False


class _NoWork:
    """What is done with packets where nobody has work for the copy: they are handed over."""

    stand_ins: Sequence[object] = ()

    def is_worth_it(self, packets: PacketBatch) -> bool:
        return True

    def share(self) -> None:
        pass

    def work(self, packets: PacketBatch) -> Iterator[Done]:
        yield Done(packets)

    def take(self, done: PacketBatch, data: memoryview) -> PacketBatch:
        return done


def batches_of(reader: WindowReader, work: AheadWork | None = None) -> Iterator[PacketBatch]:
    """Yield what ``reader.batches()`` does, made by a second process where that is possible and worth it.

    That process does the ``work`` that there is for it. What comes first is read here: who wants no more is not kept
    waiting for a process.
    """
    batches = reader.batches()
    first = next(batches, None)
    if first is None:
        return
    window = reader.content.window()
    few = len(first)
    if work is not None and _may_be_copied(window, reader):
        few = min(_FEW, few)
    yield first[:few]
    if few < len(first):
        batches = chain([first[few:]], batches)
    if _may_be_copied(window, reader):
        if work is None or not work.is_worth_it(first):
            work = _NoWork()
        yield from made_by_a_copy(reader, batches, window, work)
    else:
        yield from batches


def _may_be_copied(window: ByteWindow, reader: WindowReader) -> TypeGuard[MappedWindow]:
    ahead_bytes = reader.sizes.ahead_bytes
    return isinstance(window, MappedWindow) and is_worth_it(window.size - reader.position, ahead_bytes)


def is_worth_it(rest_bytes: int, ahead_bytes: int) -> bool:
    """Tell whether so much is to be read that a process for it pays, and whether it can be had.

    A process with several threads cannot be copied safely, and on one core there is nothing to be won.
    """
    if rest_bytes < ahead_bytes or sys.platform != "linux":
        return False
    return threading.active_count() == 1 and len(os.sched_getaffinity(0)) > 1


def made_by_a_copy(
    reader: WindowReader, batches: Iterator[PacketBatch], window: MappedWindow, work: AheadWork
) -> Iterator[PacketBatch]:
    """Yield the rest of ``batches``, which are those of ``reader`` over ``window``, made by a copy of this process."""
    # Both have come equally far; what the copy finds is put in here, and taken back if it fails.
    begin = _state(reader, Progress(), [])
    work.share()
    try:
        slots = Slots((window.data, *work.stand_ins), reader.sizes.slot_bytes)
    except OSError:  # no more descriptors, no memory
        yield from _made_here(batches, work, 0)
        return
    try:
        copy = os.fork()
    except OSError:  # no more processes, no memory
        copy = -1
    if copy == 0:
        _make(reader, batches, slots, work)
    slots.receive_here()
    parts = 0
    ended = False
    try:
        for (done, state), data in slots.received():
            _set_state(reader, state)
            ended = state.ends
            if ended:
                break
            parts += 1
            yield work.take(done, data)
            window.release(state.position)
    finally:
        if copy > 0:
            with suppress(ProcessLookupError):
                os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)
        slots.close()
    if not ended:
        _set_state(reader, begin, anew=True)
        yield from _made_here(batches, work, parts)


def _make(reader: WindowReader, batches: Iterator[PacketBatch], slots: Slots, work: AheadWork) -> Never:
    """Hand over what is done with batches, until the end, or until nobody waits for it; in the copy."""
    try:
        # Keys go to both processes; what a signal means is for the other one to say. Of what was garbage when the copy
        # was made, nothing is to be closed twice.
        gc.disable()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for name in (signal.SIGBUS, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
            signal.signal(name, signal.SIG_DFL)
        slots.send_here()
        known, channels = Progress(comments=list(reader.progress.comments)), list(reader.channels)
        for done in _done(batches, work):
            state = _state(reader, known, channels)
            known, channels = Progress(comments=list(reader.progress.comments)), list(reader.channels)
            if not slots.send((done.value, state), done.data):
                break
        else:
            slots.send((None, _state(reader, known, channels, ends=True)))
    finally:
        # As little as that: no buffers written again, no temporary files removed.
        os._exit(0)


def _made_here(batches: Iterator[PacketBatch], work: AheadWork, parts: int) -> Iterator[PacketBatch]:
    """Yield what is done with batches, without so many parts of it, which are done all the same."""
    for done in _done(batches, work):
        if parts:  # that was taken before, as the copy did it
            parts -= 1
        else:
            yield work.take(done.value, done.data.copied())


def _done(batches: Iterator[PacketBatch], work: AheadWork) -> Iterator[Done]:
    """Yield what is done with batches in which there is something."""
    for batch in batches:
        if len(batch):
            yield from work.work(batch)


def _state(reader: WindowReader, known: Progress, channels: list[str], *, ends: bool = False) -> _State:
    """Return how far a reader is; of comments and channels, those behind the ones that are known."""
    progress = {name: getattr(reader.progress, name) for name in _progress_names()}
    progress["comments"] = reader.progress.comments[len(known.comments) :]
    return _State(reader.position, progress, reader.channels[len(channels) :], ends)


def _set_state(reader: WindowReader, state: _State, *, anew: bool = False) -> None:
    """Let a reader be as far as is told, which goes on from the state before, or says all ``anew``."""
    reader.position = state.position
    for name in _progress_names():
        if name != "comments":
            setattr(reader.progress, name, state.progress[name])
    if anew:
        reader.progress.comments.clear()
        reader.channels.clear()
    reader.progress.comments.extend(state.progress["comments"])
    reader.channels.extend(state.channels)


def _progress_names() -> list[str]:
    # When the first and the last packet came is noted where batches are passed on.
    return [name for name in Progress.__struct_fields__ if name not in ("start_ns", "end_ns")]
