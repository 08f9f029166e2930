"""Where the objects of a BLF file begin: found at once by their mark, and held against the size each tells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U8
from nvscope.capture.can.blf_containers import OBJECT_HEAD
from nvscope.capture.can.blf_objects import KINDS

MAX_PADDING_BYTES = 4
"""The next object begins so many bytes behind the end of one at most."""

_MARK = int.from_bytes(b"LOBJ", "little")
_MARK_BYTES = 4
_LARGEST_FRAME_BYTES = 4096


class Walk(NamedTuple):
    """The objects of a stretch: ``at`` are the places of those that are whole.

    The next object is to be looked for from ``rest``, which lies behind the stretch where one is passed over that ends
    there. ``fault`` is what is wrong at ``rest``, '' for nothing.
    """

    at: I64
    rest: int
    fault: str = ""


def walk(data: U8, start: int, end: int) -> Walk:
    """Return the objects between two places of a buffer; at ``start``, or up to four bytes behind it, one begins."""
    nothing = np.empty(0, np.int64)
    room = end - start - _MARK_BYTES + 1
    if room <= 0:
        return Walk(nothing, start)
    fours = np.ndarray((room,), "<u4", data, offset=start, strides=(1,))
    mark = np.flatnonzero(fours == _MARK) + start
    whole_head = mark[mark + OBJECT_HEAD.size <= end]
    size = _words(data, whole_head + 8)
    behind = whole_head + size
    following = np.searchsorted(mark, behind)
    gap = np.append(mark, end + MAX_PADDING_BYTES + 1)[following] - behind
    # An object that the next mark follows: all others are looked at one by one.
    plain = (size >= OBJECT_HEAD.size) & (behind <= end) & (gap <= MAX_PADDING_BYTES)
    plain &= following == np.arange(1, len(whole_head) + 1)
    special = np.append(np.flatnonzero(~plain), len(whole_head))
    taken: list[I64] = []
    here, number = start, 0
    while True:
        if number >= len(mark) or mark[number] - here > MAX_PADDING_BYTES:
            # A mark may begin within the padding and be cut by the end of the stretch.
            cut = here + MAX_PADDING_BYTES + _MARK_BYTES > end
            return _walked(taken, here, "" if cut else "no object begins here")
        if number >= len(whole_head):
            return _walked(taken, here)
        stop = int(special[np.searchsorted(special, number)])
        taken.append(whole_head[number:stop])
        if stop > number:
            here = int(behind[stop - 1])
            number = stop
            continue
        at, bytes_told = int(whole_head[number]), int(size[number])
        if bytes_told < OBJECT_HEAD.size:
            return _walked(taken, at, f"an object of {bytes_told} bytes, expected at least {OBJECT_HEAD.size}")
        if behind[number] > end:
            kind = int(_words(data, whole_head[number : number + 1] + 12)[0])
            if kind not in KINDS:
                return _walked(taken, at + bytes_told)
            too_large = bytes_told > _LARGEST_FRAME_BYTES
            return _walked(taken, at, f"a CAN frame in an object of {bytes_told} bytes" if too_large else "")
        taken.append(whole_head[number : number + 1])
        here, number = int(behind[number]), int(following[number])


def _walked(taken: list[I64], rest: int, fault: str = "") -> Walk:
    return Walk(np.concatenate(taken) if taken else np.empty(0, np.int64), rest, fault)


def _words(data: U8, at: I64) -> I64:
    count = max(len(data) - 3, 0)
    every: np.ndarray[tuple[int], np.dtype[np.uint32]] = np.ndarray((count,), "<u4", data, strides=(1,))
    return every[at].astype(np.int64)
