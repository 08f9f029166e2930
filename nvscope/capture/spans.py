"""Copies many spans of bytes of different lengths at once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dissectors.batch import I32, I64, U8

BATCH_BYTES = 32 << 20
"""Bytes that are copied at once where many packets are."""

_LARGEST_BLOCK = 512


def copy_spans(target: U8, target_at: I64, source: U8, source_at: I64, length: I64) -> None:
    """Copy ``length[i]`` bytes from ``source_at[i]`` of the source to ``target_at[i]`` of the target, for all i.

    A span of 2ⁿ to 2ⁿ⁺¹ − 1 bytes is two blocks of 2ⁿ bytes, which overlap; blocks of one size are copied in one go.
    """
    block = 1
    while block < _LARGEST_BLOCK:
        rows = np.flatnonzero((length >= block) & (length < 2 * block))
        if len(rows):
            to, start, rest = target_at[rows], source_at[rows], length[rows] - block
            _copy_blocks(target, to, source, start, block)
            if block > 1:
                _copy_blocks(target, to + rest, source, start + rest, block)
        block *= 2
    rows = np.flatnonzero(length >= block)
    if len(rows):
        to, start, size = target_at[rows], source_at[rows], length[rows]
        counts = size // block
        firsts = np.cumsum(counts) - counts
        step = (np.arange(int(counts.sum())) - np.repeat(firsts, counts)) * block
        _copy_blocks(target, np.repeat(to, counts) + step, source, np.repeat(start, counts) + step, block)
        _copy_blocks(target, to + size - block, source, start + size - block, block)


def put_blocks(target: U8, target_at: I64, blocks: np.ndarray[tuple[int, int], np.dtype[np.uint32]]) -> None:
    """Copy the rows of a contiguous table to ``target_at``, each as its bytes in memory."""
    rows = blocks.view(f"V{blocks.shape[1] * blocks.itemsize}")[:, 0]
    to_blocks = np.ndarray((len(target) - rows.itemsize + 1,), rows.dtype, buffer=target, strides=(1,))
    to_blocks[target_at] = rows


def _copy_blocks(target: U8, target_at: I64, source: U8, source_at: I64, block: int) -> None:
    # A void item of any size is copied as one block of memory.
    from_blocks = np.ndarray((len(source) - block + 1,), f"V{block}", buffer=source, strides=(1,))
    to_blocks = np.ndarray((len(target) - block + 1,), f"V{block}", buffer=target, strides=(1,))
    to_blocks[target_at] = from_blocks[source_at]


def stretches(length: I32 | I64, most_rows: int, most_bytes: int) -> Iterator[slice]:
    """Yield slices that cover all rows in order, each of few enough rows and bytes, but of at least one row."""
    total = np.cumsum(length, dtype=np.int64)
    begin = 0
    while begin < len(total):
        before = int(total[begin - 1]) if begin else 0
        full = int(np.searchsorted(total, before + most_bytes, "right"))
        end = max(begin + 1, min(begin + most_rows, full))
        yield slice(begin, end)
        begin = end
