"""Frames of a source to one file: all of them, or those that a filter chooses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from nvscope.capture.formats import CaptureFormat
from nvscope.capture.mcap.sink import TopicSink
from nvscope.capture.source import Sink, SourceInfo
from nvscope.engine.told import Told
from nvscope.record.topics import ListTopics


class FrameFile:
    """An observer that writes the frames which the filter of the reading chooses, or all of them, to a sink;
    with ``topics``, what these say to one that takes that.

    ``frames`` is how many it was told; ``has_directions`` whether one of those that it wrote has a direction.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, sink: Sink, topics: ListTopics | None = None) -> None:
        self._sink = sink
        self._topics = topics if isinstance(sink, TopicSink) else None
        if self._topics is not None and isinstance(sink, TopicSink):
            self._topics.declare(sink)
        self.frames = 0
        self.written = 0
        self.has_directions = False

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.frames += len(told)
        packets, chosen = told.packets, told.chosen
        if chosen is not None:
            packets = packets.take(np.flatnonzero(chosen))
        if len(packets):
            self._sink.write(packets)
            self.written += len(packets)
            if self._topics is not None and isinstance(self._sink, TopicSink):
                self._topics.observe(told)
                self._topics.write(self._sink, told.first_frame, told.first_frame + len(told))
            self.has_directions |= packets.direction is not None and bool(packets.direction.any())


def not_held(
    target: CaptureFormat, infos: Sequence[SourceInfo], channels: Sequence[str], attachments: Sequence[str], *,
    has_directions: bool,
) -> list[str]:  # fmt: skip
    """Return what of sources a file of a format cannot hold, in words; nothing where it holds all."""
    comments = sum(len(info.comments) for info in infos)
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
