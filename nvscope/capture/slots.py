"""Slots: shared memory by which a process hands over values with large columns to the one that made it.

The columns of a value go through the memory, and so do bytes that are handed over beside it; what has no room there
goes through the pipe that tells of it. There are several slots, so that neither process waits for the other each time.
"""

from __future__ import annotations

import io
import mmap
import os
import pickle
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import count
from typing import IO, Any, NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.stretches import NOTHING, Uncopied

_SLOTS = 3
_ALIGNMENT = 64
_FREE = b"\0"


class HandedOver(NamedTuple):
    """A value, and the bytes beside it, which are valid until the next one is received."""

    value: Any
    data: memoryview


class _Message(Struct, frozen=True):
    """What is told of a slot: where in it the columns of a value are, and how many bytes of the data beside it.

    ``pickled`` is the value without its columns: where in the slot, or, where there was no room, itself; so is ``data``
    where it had none.
    """

    columns: Sequence[tuple[int, int]]
    data_bytes: int
    pickled: tuple[int, int] | bytes
    data: bytes | None = None


class Slots:
    """Memory that two processes share, made before the second one is.

    ``stand_ins`` are objects that both of them have: what is in a value of one stands for that of the other. One end
    receives, the other one sends; each is to be told of which process it is (``receive_here``, ``send_here``). Raises
    OSError where there is no memory, or no descriptor is left.
    """

    def __init__(self, stand_ins: Sequence[object], size_bytes: int) -> None:
        self._stand_ins = stand_ins
        self._size_bytes = size_bytes
        self._memory = [mmap.mmap(-1, size_bytes) for _ in range(_SLOTS)]
        ends = os.pipe()
        try:
            self._wait, self._free = os.pipe()
        except OSError:
            for end in ends:
                os.close(end)
            raise
        self._told, self._tells = ends
        self._turn = 0
        self._messages: IO[bytes]
        self._freed: IO[bytes]

    def receive_here(self) -> None:
        """Take that this process receives."""
        os.close(self._tells)
        os.close(self._wait)
        self._messages, self._freed = os.fdopen(self._told, "rb"), os.fdopen(self._free, "wb", 0)

    def send_here(self) -> None:
        """Take that this process sends."""
        os.close(self._told)
        os.close(self._free)
        self._messages, self._freed = os.fdopen(self._tells, "wb"), os.fdopen(self._wait, "rb", 0)

    def close(self) -> None:
        """Close this end; whoever is at the other one hears of it."""
        for end in (self._messages, self._freed):
            with suppress(OSError):
                end.close()

    def send(self, value: Any, data: Uncopied = NOTHING) -> bool:
        """Hand over a value, and data beside it; return False where nobody receives any more."""
        if self._turn >= _SLOTS and not self._freed.read(len(_FREE)):
            return False
        memory = self._memory[self._turn % _SLOTS]
        self._turn += 1
        room = _Room(memory, self._size_bytes)
        rest = room.copy(data)
        columns: list[tuple[int, int]] = []

        def has_no_room(column: pickle.PickleBuffer) -> bool:
            place = room.put(column.raw())
            if place is not None:
                columns.append(place)
            return place is None

        file = io.BytesIO()
        _Pickler(file, self._stand_ins, has_no_room).dump(value)
        pickled = file.getbuffer()
        try:
            pickle.dump(_Message(columns, data.size_bytes, room.put(pickled) or bytes(pickled), rest), self._messages)
            self._messages.flush()
        except BrokenPipeError:
            return False
        return True

    def received(self) -> Iterator[HandedOver]:
        """Yield what is handed over, until the other end is closed, or breaks off."""
        for turn in count():
            try:
                message: _Message = pickle.load(self._messages)  # from a copy of this process, through its own pipe
            except (EOFError, OSError, pickle.UnpicklingError):
                return
            view = memoryview(self._memory[turn % _SLOTS])
            # Of columns, there are copies: whoever looks at them may keep them.
            columns = [bytearray(view[begin:end]) for begin, end in message.columns]
            place = message.pickled
            pickled = io.BytesIO(place if isinstance(place, bytes) else view[slice(*place)])
            value = _Unpickler(pickled, self._stand_ins, columns).load()
            data = view[: message.data_bytes] if message.data is None else memoryview(message.data)
            yield HandedOver(value, data)
            with suppress(OSError):  # it has gone, which the next message says
                self._freed.write(_FREE)


class _Pickler(pickle.Pickler):
    def __init__(self, file: IO[bytes], stand_ins: Sequence[object], has_no_room: Any) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL, buffer_callback=has_no_room)
        self._numbers = {id(one): number for number, one in enumerate(stand_ins)}

    def persistent_id(self, obj: Any) -> int | None:
        return self._numbers.get(id(obj))


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: IO[bytes], stand_ins: Sequence[object], columns: Iterable[bytearray]) -> None:
        super().__init__(file, buffers=columns)
        self._stand_ins = stand_ins

    def persistent_load(self, pid: int) -> object:
        return self._stand_ins[pid]


class _Room:
    """What is free of a slot."""

    def __init__(self, memory: mmap.mmap, size_bytes: int) -> None:
        self._memory, self._size_bytes = memory, size_bytes
        self._at = 0

    def put(self, data: memoryview) -> tuple[int, int] | None:
        """Put something there; return where it is, None where there is no room."""
        begin = -(-self._at // _ALIGNMENT) * _ALIGNMENT
        end = begin + data.nbytes
        if end > self._size_bytes:
            return None
        self._memory[begin:end] = data
        self._at = end
        return begin, end

    def copy(self, data: Uncopied) -> bytes | None:
        """Copy data there; return all of it where there is no room, else None."""
        end = self._at + data.size_bytes
        if end > self._size_bytes:
            return data.copied().tobytes()
        if data.size_bytes:
            data.copy(np.frombuffer(self._memory, np.uint8, data.size_bytes, self._at))
        self._at = end
        return None
