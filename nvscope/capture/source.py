"""What a capture source and a sink are: an iterable of packet batches, and something that takes them.

A source tells about itself in ``info``, which is complete when the iteration has ended.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from dissectors.batch import PacketBatch


@dataclass(slots=True)
class Truncation:
    """Where a file stops in the middle of a record."""

    offset: int
    message: str


@dataclass(slots=True)
class SourceInfo:
    """What is known of a source apart from its packets.

    ``bytes`` is the size on disk (of a stream: the bytes read from it). ``drops`` counts the packets that the capturing
    side says it lost. ``comments`` are those of a pcapng file, as (frame number within the file or None, text).
    """

    path: str
    format: str
    bytes: int = 0
    frames: int = 0
    drops: int = 0
    truncation: Truncation | None = None
    comments: list[tuple[int | None, str]] = field(default_factory=list)


class Source(Protocol):
    """Packets in batches; iterate once, then read ``infos`` (one entry a file).

    ``channels`` are the names of the channels of the packets, by number; it grows as packets come.
    """

    @property
    def infos(self) -> list[SourceInfo]: ...

    @property
    def channels(self) -> Sequence[str]: ...

    def __iter__(self) -> Iterator[PacketBatch]: ...


class Sink(Protocol):
    """Something that packets can be written to."""

    def write(self, batch: PacketBatch) -> None: ...

    def close(self) -> None: ...
