"""A source of which the first frame is known before it is read."""

from __future__ import annotations

from collections.abc import Iterator

from dissectors.batch import PacketBatch
from nvscope.capture.derived import DerivedSource
from nvscope.capture.source import FileSource, Source


class Begun(DerivedSource):
    """A source of which the first batches have been asked for already."""

    def __init__(self, source: Source) -> None:
        super().__init__(source)
        self._batches = iter(source)
        self._first: list[PacketBatch] = []
        self.first_ns: int | None = None
        for batch in self._batches:
            self._first.append(batch)
            if len(batch):
                self.first_ns = int(batch.ts_ns[0])
                return

    def __iter__(self) -> Iterator[PacketBatch]:
        yield from self._first
        self._first.clear()
        yield from self._batches

    def between(self, start_ns: int | None, end_ns: int | None) -> Source:
        return self._source.between(start_ns, end_ns)


def begun(source: Source) -> tuple[Source, int | None]:
    """Return a source, to be read in place of this one, and the time of its first frame; None for none."""
    if isinstance(source, FileSource):
        return source, source.first_ts_ns()
    waited = Begun(source)
    return waited, waited.first_ns
