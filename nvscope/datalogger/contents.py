"""Contents: what telegrams are beside their Counter, each as one number, by which those that are equal are found."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U64
from dissectors.layout import gather_bytes
from nvscope.engine.rows import DataRows
from nvscope.engine.runs import distinct
from nvscope.engine.told import Told

_AT_ONCE = 8192
_FACTOR = np.uint64(0x9E3779B97F4A7C15)
_HALF = np.uint64(32)


def contents_of(told: Told, rows: DataRows) -> U64:
    """Return a number of 64 bits for each telegram: of its Items, Length, Flags and Checksum, and its bytes.

    Two that differ have the same one by chance alone, once in 10 to the power of 19.
    """
    varieties, packets = told.varieties, told.packets
    carried = varieties.carried
    size_bytes = carried.captured_bytes[rows.variety]
    at = packets.offset[rows.packet] + carried.at[rows.variety]
    found = mixed(np.zeros(len(rows), np.uint64), told.keys.varieties.signature[rows.variety])
    for size in distinct(size_bytes).tolist():
        own = np.flatnonzero(size_bytes == size)
        for begin in range(0, len(own) if size else 0, _AT_ONCE):
            some = own[begin : begin + _AT_ONCE]
            found[some] = _with_bytes(found[some], packets.data, at[some], size)
    return found


def mixed(number: U64, other: U64) -> U64:
    """Return numbers that tell both of two apart."""
    found = (number ^ other) * _FACTOR
    return found ^ (found >> _HALF)


def _with_bytes(number: U64, data: np.ndarray[tuple[int], np.dtype[np.uint8]], at: I64, size: int) -> U64:
    padded = np.zeros((len(at), -(-size // 8) * 8), np.uint8)
    padded[:, :size] = gather_bytes(data, at, size).view(np.uint8).reshape(len(at), size)
    words = padded.view(np.uint64)
    for column in range(words.shape[1]):
        number = mixed(number, words[:, column])
    return number
