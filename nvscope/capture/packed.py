"""Batches copied to memory of their own, with little between their packets: what is kept when their buffer goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, PAD_BYTES, U8, PacketBatch
from nvscope.capture.spans import copy_spans

if TYPE_CHECKING:
    from dissectors.datalogger.logged import Logged


def gathered(parts: Sequence[PacketBatch]) -> tuple[U8, list[I64]]:
    """Copy the packets of batches over different buffers to one; return it and the offsets of each batch in it."""
    regions: list[U8] = []
    offsets: list[I64] = []
    size = 0
    for part in parts:
        if not len(part):
            offsets.append(part.offset)
            continue
        first = int(part.offset.min())
        region = part.data[first : int((part.offset + part.captured).max())]
        captured = part.captured.astype(np.int64)
        start = part.offset - first
        if len(region) > 2 * int(captured.sum()) + 64 * len(part):
            packed_start = np.cumsum(captured) - captured
            packed = np.empty(int(captured.sum()), np.uint8)
            copy_spans(packed, packed_start, region, start, captured)
            region, start = packed, packed_start
        offsets.append(start + size)
        regions.append(region)
        size += len(region)
    regions.append(np.zeros(PAD_BYTES, np.uint8))
    return np.concatenate(regions), offsets


def packed(parts: Sequence[PacketBatch]) -> PacketBatch:
    """Return the packets of batches, at least one, as one batch over memory of its own; nothing is told of time."""
    data, offsets = gathered(parts)
    links = {part.single_link for part in parts if len(part)}
    only = links.pop() if len(links) == 1 else None
    count = sum(map(len, parts))
    link = np.concatenate([part.link for part in parts]) if only is None else PacketBatch.link_column(only, count)
    sources = {_single_source(part) for part in parts if len(part)}
    of = sources.pop() if len(sources) == 1 else None
    source = None
    if of is not None:
        source = PacketBatch.source_column(of, count)
    elif all(part.source is not None for part in parts if len(part)):
        source = np.concatenate([part.source for part in parts if part.source is not None])
    return replace(
        PacketBatch.nothing(),
        data=data,
        offset=np.concatenate(offsets),
        captured=np.concatenate([part.captured for part in parts]),
        original=np.concatenate([part.original for part in parts]),
        ts_ns=np.concatenate([part.ts_ns for part in parts]),
        link=link,
        channel=np.concatenate([part.channels for part in parts]) if _any(parts, "channel") else None,
        direction=np.concatenate([part.directions for part in parts]) if _any(parts, "direction") else None,
        source=source,
        logged=logged_of(parts),
    )


def logged_of(parts: Sequence[PacketBatch]) -> Logged | None:
    """Return of which tables the packets of batches are, one behind the other; None where none is a row."""
    if not _any(parts, "logged"):
        return None
    from dissectors.datalogger.logged import Logged  # noqa: PLC0415  # captures have none

    return Logged.joined([part.logged for part in parts], [len(part) for part in parts])


def _any(parts: Sequence[PacketBatch], column: str) -> bool:
    return any(getattr(part, column) is not None for part in parts)


def _single_source(part: PacketBatch) -> int | None:
    if part.source is None or not len(part.source):
        return None
    return int(part.source[0]) if part.source.strides == (0,) else None
