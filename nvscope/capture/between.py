"""The part of a source that lies in a span of time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from dissectors.batch import PacketBatch
from nvscope.capture.derived import DerivedSource
from nvscope.capture.source import FileSource
from nvscope.capture.time_span import TimeSpan


class Spanned(FileSource, Protocol):
    """Files that may leave out cheaply what nobody wants."""

    def read(self, share: int, span: TimeSpan) -> Iterator[PacketBatch]:
        """Yield the packets in their order; those outside the span may be left out.

        Where that could change the order of several sources, an empty batch with the last time that was left out, as
        ``until_ns``, stands for them. It is read with a ``share``-th of the memory that a single source would take.
        """
        ...


class Between(DerivedSource):
    """The packets of a source that lie in a span of time, in its order; everything else is that of the source.

    Also ``first_ts_ns`` and ``first_batches`` are: they tell of the files, not of the span.
    """

    _source: Spanned

    def __init__(self, source: Spanned, span: TimeSpan) -> None:
        super().__init__(source)
        self._span = span

    def __iter__(self) -> Iterator[PacketBatch]:
        for batch in self._source.read(1, self._span):
            part = self._span.part(batch)
            if part is not None:
                yield part

    def between(self, start_ns: int | None, end_ns: int | None) -> Between:
        """Return the packets that lie in this span and in another."""
        return Between(self._source, self._span & TimeSpan.of(start_ns, end_ns))

    @property
    def size_bytes(self) -> int | None:
        return self._source.size_bytes

    @property
    def position_bytes(self) -> int:
        return self._source.position_bytes

    def first_ts_ns(self) -> int | None:
        """Return the time of the first packet of the files, or None where there is none."""
        return self._source.first_ts_ns()

    def first_batches(self) -> Iterator[PacketBatch]:
        """Yield what each file begins with, if anything."""
        return self._source.first_batches()
