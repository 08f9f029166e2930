"""The objects of a BLF file as CAN frames, by columns: those of one type are read at once.

::

    object  "LOBJ" | header size u16 | version u16 | object size u32 | type u32 | flags u32 | … | time u64 at 24 | body

An object ends where its size says; the next one begins up to four bytes behind it. Sources: python-can's
``can.io.blf``; for bodies the comments of Technica-Engineering/vector_blf (``CanMessage2.h``, ``CanFdMessage64.h``,
``CanErrorFrameExt.h`` …). A message of direction 2 is a request to send, and none on the bus.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, PAD_BYTES, U8, U16, U32, Bool, Direction, Records
from dissectors.can.frame import FD_LENGTHS
from nvscope.capture.can import error_frame
from nvscope.capture.can.frame import (
    BIT_RATE_SWITCH,
    CLASSIC_WORDS,
    ERROR_STATE,
    EXTENDED,
    FD_FRAME,
    FD_WORDS,
    HEAD_BYTES,
    IDENTIFIER,
    MAX_DATA_BYTES,
    MAX_FD_DATA_BYTES,
    REMOTE,
    STANDARD_IDENTIFIER,
    CanRows,
)
from nvscope.capture.time_span import TIME_LIMIT_NS

HEAD = np.dtype(
    {
        "names": ["header_bytes", "version", "bytes", "type", "flags", "time"],
        "formats": ["<u2", "<u2", "<u4", "<u4", "<u4", "<u8"],
        "offsets": [4, 6, 8, 12, 16, 24],
        "itemsize": 32,
    }
)
_VERSIONS = (1, 2, 3)
_TEN_MICROSECONDS = 1
_REMOTE_MESSAGE, _REMOTE_MESSAGE_64 = 0x80, 0x10
_DIRECTION_BITS, _REQUESTED = 0x0F, 2
_MAX_DLC = 15
_LENGTH_OF_DLC = np.array(FD_LENGTHS, np.int64)

_MESSAGE = np.dtype([("channel", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4"), ("data", "V8")])
_FD_MESSAGE = np.dtype(
    [
        ("channel", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4"), ("frame_ns", "<u4"), ("bits", "u1"),
        ("fd_flags", "u1"), ("valid", "u1"), ("reserved", "V5"),
    ]
)  # fmt: skip
_FD_MESSAGE_64 = np.dtype(
    [
        ("channel", "u1"), ("dlc", "u1"), ("valid", "u1"), ("tries", "u1"), ("id", "<u4"), ("frame_ns", "<u4"),
        ("flags", "<u4"), ("rates", "V8"), ("offsets", "V8"), ("bits", "<u2"), ("direction", "u1"), ("ext_at", "u1"),
        ("crc", "<u4"),
    ]
)  # fmt: skip
_ERROR = np.dtype([("channel", "<u2"), ("length", "<u2")])
_ERROR_EXT = np.dtype(
    [
        ("channel", "<u2"), ("length", "<u2"), ("flags", "<u4"), ("ecc", "u1"), ("position", "u1"), ("dlc", "u1"),
        ("reserved", "u1"), ("frame_ns", "<u4"), ("id", "<u4"), ("code", "<u2"), ("reserved2", "<u2"),
    ]
)  # fmt: skip
_FD_ERROR_64 = np.dtype(
    [
        ("channel", "u1"), ("dlc", "u1"), ("valid", "u1"), ("ecc", "u1"), ("flags", "<u2"), ("code", "<u2"),
    ]
)  # fmt: skip


class _Objects(NamedTuple):
    """Objects of one type: ``body`` is where their bodies begin in ``data``, ``end`` where they end."""

    data: U8
    at: I64
    body: I64
    end: I64
    layout: np.dtype[np.void]

    def gathered(self) -> Records:
        return gather(self.data, self.body, self.layout)


class _Read(NamedTuple):
    """What the bodies of some objects say: frames without times, what is wrong with each, and which are frames."""

    rows: CanRows
    fault: Mapping[str, Bool]
    is_frame: Bool | None = None


def gather(data: U8, at: I64, layout: np.dtype[np.void]) -> Records:
    """Return the structures at places of a buffer, each of which is followed by ``PAD_BYTES`` bytes."""
    count = max(len(data) - layout.itemsize + 1, 0)
    every: Records = np.ndarray((count,), layout, data, strides=(1,))
    return every[at]


def _keep(longest: int) -> U32:
    """Return for 0 to ``longest`` bytes which bits of the words that hold them are theirs."""
    table = np.zeros((longest + 1, longest), np.uint8)
    for count in range(longest + 1):
        table[count, :count] = 0xFF
    words: U32 = table.view(np.uint32)
    return words


_KEEP, _KEEP_FD = _keep(MAX_DATA_BYTES), _keep(MAX_FD_DATA_BYTES)


def _rows(
    channel: U16, word: U32, length: I64, fd_flags: U32, raw_dlc: I64, held: I64, data: U32, direction: U8
) -> CanRows:
    """Return frames of which ``held`` bytes of ``data`` count; ``word`` has the flags of the identifier."""
    count, data_words = data.shape
    words = np.empty((count, FD_WORDS if data_words > 2 else CLASSIC_WORDS), np.uint32)
    words[:, 0] = word.byteswap()
    words[:, 1] = length.astype(np.uint32) | fd_flags << np.uint32(8) | raw_dlc.astype(np.uint32) << np.uint32(24)
    words[:, 2:] = data & (_KEEP_FD if data_words > 2 else _KEEP)[held]
    remote = word & np.uint32(REMOTE) != 0
    return CanRows(
        words,
        (held + HEAD_BYTES).astype(np.int32),
        np.where(remote, HEAD_BYTES, length + HEAD_BYTES),
        np.zeros(count, np.int64),
        channel.astype(np.uint16),
        direction,
    )


def _identifiers(told: U32) -> tuple[U32, Bool]:
    """Return identifiers with their flag, and which of them have more bits than they may."""
    extended = told & np.uint32(EXTENDED) != 0
    most = np.where(extended, np.uint32(IDENTIFIER), np.uint32(STANDARD_IDENTIFIER))
    return told & np.uint32(EXTENDED | IDENTIFIER), (told & np.uint32(IDENTIFIER)) > most


def _directions(told: U8) -> U8:
    direction: U8 = np.select([told == 0, told == 1], [Direction.RX, Direction.TX], Direction.UNKNOWN).astype(np.uint8)
    return direction


def _frames(
    objects: _Objects, channel: U16, told: U32, dlc: U8, fd_flags: U32, remote: Bool, valid: I64, way: U8
) -> _Read:
    """Return data and remote frames of which ``valid`` bytes are told, behind the layout of their objects.

    What of these lies behind the end of an object is zero.
    """
    word, too_wide = _identifiers(told)
    code = np.minimum(dlc, _MAX_DLC).astype(np.int64)
    is_fd = fd_flags != 0
    remote = remote & ~is_fd
    length = np.where(is_fd, _LENGTH_OF_DLC[code], np.minimum(code, MAX_DATA_BYTES))
    raw_dlc = np.where(~is_fd & (code > MAX_DATA_BYTES), code, 0)
    word = word | np.where(remote, np.uint32(REMOTE), np.uint32(0))
    held = np.where(remote, 0, np.minimum(valid, length))
    begin = objects.body + objects.layout.itemsize
    present = np.clip(objects.end - begin, 0, held)
    if is_fd.any():
        content = gather(objects.data, begin, np.dtype("V64")).view(np.uint32).reshape(-1, FD_WORDS - 2)
        content = content & _KEEP_FD[present]
    else:
        content = gather(objects.data, begin, np.dtype("V8")).view(np.uint32).reshape(-1, CLASSIC_WORDS - 2)
        content = content & _KEEP[present]
    rows = _rows(channel, word, length, fd_flags, raw_dlc, held, content, _directions(way))
    faults = {"an identifier of more than 11 bits": too_wide, "a data length code above 15": dlc > _MAX_DLC}
    return _Read(rows, faults, way != _REQUESTED)


def _message(objects: _Objects) -> _Read:
    body = objects.gathered()
    # The eight bytes of data are at the end of the layout, and are gathered again as data.
    begin = objects._replace(layout=np.dtype("V8"))
    remote = body["flags"] & _REMOTE_MESSAGE != 0
    none = np.zeros(len(body), np.uint32)
    valid = np.full(len(body), MAX_DATA_BYTES, np.int64)
    way = body["flags"] & np.uint8(_DIRECTION_BITS)
    return _frames(begin, body["channel"], body["id"], body["dlc"], none, remote, valid, way)


def _fd_flags(fast: Bool, switch: Bool, state: Bool) -> U32:
    flags = np.where(switch, np.uint32(BIT_RATE_SWITCH), np.uint32(0))
    flags |= np.where(state, np.uint32(ERROR_STATE), np.uint32(0))
    return np.where(fast, flags | np.uint32(FD_FRAME), np.uint32(0))


def _fd_message(objects: _Objects) -> _Read:
    body = objects.gathered()
    told = body["fd_flags"]
    flags = _fd_flags(told & 1 != 0, told & 2 != 0, told & 4 != 0)
    remote = body["flags"] & _REMOTE_MESSAGE != 0
    way = body["flags"] & np.uint8(_DIRECTION_BITS)
    valid = body["valid"].astype(np.int64)
    return _frames(objects, body["channel"], body["id"], body["dlc"], flags, remote, valid, way)


def _fd_message_64(objects: _Objects) -> _Read:
    body = objects.gathered()
    told = body["flags"]
    flags = _fd_flags(told & 0x1000 != 0, told & 0x2000 != 0, told & 0x4000 != 0)
    # More data lies behind the frame's where something is told of where; what is missing is 0, as in Vector's tools.
    behind = objects.at + body["ext_at"]
    objects = objects._replace(end=np.where(body["ext_at"] > 0, np.minimum(behind, objects.end), objects.end))
    remote = told & _REMOTE_MESSAGE_64 != 0
    valid = body["valid"].astype(np.int64)
    return _frames(objects, body["channel"], body["id"], body["dlc"], flags, remote, valid, body["direction"])


def _errors(channel: U16, found: list[error_frame.ErrorFrame], which: I64) -> _Read:
    word = np.array([error.identifier for error in found], np.uint32)[which]
    data = np.frombuffer(b"".join(error.data for error in found), np.uint32).reshape(-1, 2)[which]
    count = len(which)
    whole = np.full(count, MAX_DATA_BYTES, np.int64)
    none = np.zeros(count, np.int64)
    unknown = np.zeros(count, np.uint8)
    return _Read(_rows(channel, word, whole, none.astype(np.uint32), none, whole, data, unknown), {})


def _error(objects: _Objects) -> _Read:
    body = objects.gathered()
    return _errors(body["channel"], [error_frame.UNTOLD], np.zeros(len(body), np.int64))


def _overload(objects: _Objects) -> _Read:
    body = objects.gathered()
    return _errors(body["channel"], [error_frame.OVERLOADED], np.zeros(len(body), np.int64))


def _told_error(objects: _Objects) -> _Read:
    body = objects.gathered()
    key = body["flags"].astype(np.int64) << 24 | body["code"].astype(np.int64) << 8 | body["ecc"]
    seen, which = np.unique(key, return_inverse=True)
    found = [error_frame.of_vector(one >> 24, one & 0xFF, one >> 8 & 0xFFFF) for one in seen.tolist()]
    return _errors(body["channel"], found, which)


class _Kind(NamedTuple):
    layout: np.dtype[np.void]
    read: Callable[[_Objects], _Read]


KINDS: Mapping[int, _Kind] = MappingProxyType(
    {
        1: _Kind(_MESSAGE, _message),
        2: _Kind(_ERROR, _error),
        3: _Kind(_ERROR, _overload),
        73: _Kind(_ERROR_EXT, _told_error),
        86: _Kind(_MESSAGE, _message),
        100: _Kind(_FD_MESSAGE, _fd_message),
        101: _Kind(_FD_MESSAGE_64, _fd_message_64),
        104: _Kind(_FD_ERROR_64, _told_error),
    }
)
"""The types of objects that are frames: CAN_MESSAGE, CAN_ERROR, CAN_OVERLOAD, CAN_ERROR_EXT, CAN_MESSAGE2,
CAN_FD_MESSAGE, CAN_FD_MESSAGE_64, CAN_FD_ERROR_64."""

_OF_KIND = np.zeros(256, np.bool_)
_OF_KIND[list(KINDS)] = True


class BlfFrames(NamedTuple):
    """Frames of objects, in their order; ``faults`` are places of those that are wrong, and what is."""

    rows: CanRows
    faults: list[tuple[int, str]]


def frames_of(data: U8, at: I64, start_ns: int) -> BlfFrames:
    """Return the frames among objects that begin at places of ``data``, and are whole; ``PAD_BYTES`` follow each.

    Channels are the numbers that the file gives them. Objects of other types say nothing here.
    """
    assert HEAD.itemsize + MAX_FD_DATA_BYTES <= PAD_BYTES
    head = gather(data, at, HEAD)
    kind = head["type"]
    mine = np.flatnonzero((kind < len(_OF_KIND)) & _OF_KIND[np.minimum(kind, len(_OF_KIND) - 1)])
    rows = CanRows.empty(len(mine))
    if not len(mine):
        return BlfFrames(rows, [])
    at, head = at[mine], head[mine]
    kind = head["type"]
    body = at + head["header_bytes"]
    end = at + head["bytes"]
    is_frame = np.ones(len(mine), np.bool_)
    faults: list[tuple[int, str]] = []

    def leave_out(which: I64, what: str) -> None:
        fresh = which[is_frame[which]]
        is_frame[fresh] = False
        faults.extend((place, what) for place in at[fresh].tolist())

    version = head["version"]
    leave_out(np.flatnonzero(~np.isin(version, _VERSIONS)), "a header of an unknown version")
    leave_out(np.flatnonzero(head["header_bytes"] < HEAD.itemsize), "a header that is too short")
    for one in np.unique(kind[is_frame]).tolist():
        layout, read = KINDS[one]
        some = np.flatnonzero((kind == one) & is_frame)
        leave_out(some[end[some] - body[some] < layout.itemsize], "too short for what it is")
        some = some[is_frame[some]]
        if not len(some):
            continue
        found = read(_Objects(data, at[some], body[some], end[some], layout))
        rows.put(some, found.rows)
        for what, wrong in found.fault.items():
            leave_out(some[wrong], what)
        if found.is_frame is not None:
            is_frame[some[~found.is_frame]] = False
    unit_ns = np.where(head["flags"] == _TEN_MICROSECONDS, np.uint64(10_000), np.uint64(1))
    if abs(start_ns) > TIME_LIMIT_NS:
        leave_out(np.arange(len(mine)), "a time before 1823 or after 2116")
        start_ns = 0
    room_ns = np.uint64(TIME_LIMIT_NS - start_ns)
    leave_out(np.flatnonzero(head["time"] > room_ns // unit_ns), "a time after 2116")
    rows.ts_ns[:] = (head["time"] * unit_ns).astype(np.int64) + start_ns
    return BlfFrames(rows if is_frame.all() else rows[is_frame], sorted(faults))
