"""A source whose batches are made from those of another one."""

from __future__ import annotations

from collections.abc import Sequence

from nvscope.capture.source import Attachment, Source, SourceInfo


class DerivedSource:
    """What a source that changes the batches of another one tells as that one does."""

    def __init__(self, source: Source) -> None:
        self._source = source

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return self._source.infos

    @property
    def channels(self) -> Sequence[str]:
        return self._source.channels

    @property
    def attachments(self) -> Sequence[Attachment]:
        return self._source.attachments

    def stop(self) -> None:
        self._source.stop()
