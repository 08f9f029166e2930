"""Frames of a source to one file: all of them, or those that a filter chooses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from dissectors.batch import I64
from nvscope.capture.formats import CaptureFormat
from nvscope.capture.mcap.sink import TopicSink
from nvscope.capture.source import Sink, SourceInfo
from nvscope.engine.told import Told
from nvscope.record.recorded_topics import RecordedTopics

Comment = tuple[int | None, str]
"""A comment, and the number of the frame it is to; None where it is to all."""


class FrameFile:
    """An observer that writes the frames which the filter of the reading chooses, or all of them, to a sink;
    with ``topics``, what these say to one that takes that.

    ``comments`` are those of the capture so far, by the number of their frame, and ``remarks`` further ones: they go
    with their frames. ``frames`` is how many it was told, ``written`` how many of them it wrote; ``has_directions``
    whether one of these has a direction.
    """

    def __init__(
        self, sink: Sink, topics: RecordedTopics | None = None, comments: Callable[[], Sequence[Comment]] = tuple,
        remarks: Iterable[Comment] = (),
    ) -> None:  # fmt: skip
        self._sink = sink
        self._topics = topics if isinstance(sink, TopicSink) else None
        if self._topics is not None and isinstance(sink, TopicSink):
            self._topics.declare(sink)
        self._comments = comments
        self._seen = 0
        self._waiting: dict[int, list[str]] = {}
        self._wait(remarks)
        self.frames = 0
        self.written = 0
        self.has_directions = False

    @property
    def by_stream(self) -> bool:
        """Whether there are topics: transactions are found in telegrams by stream."""
        return self._topics is not None

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.frames += len(told)
        packets, rows = told.packets, np.arange(len(told))
        if told.chosen is not None:
            rows = np.flatnonzero(told.chosen)
            packets = packets.take(rows)
        if len(packets):
            self._comment(told.first_frame, rows)
            if self._topics is not None and isinstance(self._sink, TopicSink):
                self._topics.observe(told)
                self._topics.write_with(self._sink, packets, rows + told.first_frame)
            else:
                self._sink.write(packets)
            self.written += len(packets)
            self.has_directions |= packets.direction is not None and bool(packets.direction.any())

    def _wait(self, comments: Iterable[Comment]) -> None:
        for frame, text in comments:
            if frame is not None:
                self._waiting.setdefault(frame, []).append(text)

    def _comment(self, first_frame: int, rows: I64) -> None:
        """Give the comments to some rows of a batch, which are written next, to the sink."""
        comments = self._comments()
        self._wait(comments[self._seen :])
        self._seen = len(comments)
        if not self._waiting:
            return
        frames = rows + first_frame
        waiting = np.array(sorted(self._waiting), np.int64)
        place = np.searchsorted(frames, waiting)
        found = frames[np.minimum(place, len(frames) - 1)] == waiting
        for frame, row in zip(waiting[found].tolist(), place[found].tolist(), strict=True):
            for text in self._waiting.pop(frame):
                self._sink.comment(self.written + row + 1, text)


def not_held(
    target: CaptureFormat, infos: Sequence[SourceInfo], channels: Sequence[str], attachments: Sequence[str], *,
    has_directions: bool, has_comments: bool,
) -> list[str]:  # fmt: skip
    """Return what of sources a file of a format cannot hold, in words; nothing where it holds all.

    ``has_comments``: those to frames went with them.
    """
    comments = sum(frame is None or not has_comments for info in infos for frame, _ in info.comments)
    drops = sum(info.drops or 0 for info in infos)
    names = [name for name in channels if name]
    lost = []
    if names and not target.names_channels:
        lost.append(f"the names of the interfaces ({', '.join(names)})")
    if comments:
        lost.append(f"comments ({comments})")
    if drops and not target.holds_drops:
        lost.append(f"how many frames were dropped while capturing ({drops})")
    if has_directions and not target.holds_directions:
        lost.append("which way frames went")
    if attachments and not target.holds_attachments:
        lost.append(f"attachments ({', '.join(attachments)})")
    return lost
