"""A capture that is being written, as a live source."""

from __future__ import annotations

from dataclasses import replace

from nvscope.capture.live.live_source import TICK_NS, Autostop, LiveSource
from nvscope.capture.live.stream_inlet import StreamInlet
from nvscope.capture.live.wait import Wait

LOOK_NS = 50_000_000
"""So often a file is looked at that grows: nothing tells when it does."""


class StreamSource(LiveSource):
    """The packets of a stream as they come, until it ends, or somebody or something ends it.

    Time passes in it by its own clock (``StreamClock``), which need not be that of this machine.
    """

    def __init__(self, inlet: StreamInlet, wait: Wait, autostop: Autostop | None = None) -> None:
        super().__init__(inlet, wait, autostop)
        self._stream = inlet
        self._longest_wait_ns = TICK_NS if inlet.fileno() >= 0 else LOOK_NS

    def _look(self) -> int | None:
        return self._stream.clock.until_ns()

    def _is_over(self) -> bool:
        return self._stream.ended or super()._is_over()

    def _tell(self) -> None:
        super()._tell()
        progress = self._stream.progress
        self._info = replace(
            self._info, format=self._stream.format, drops=progress.drops, truncation=progress.truncation,
            comments=tuple(progress.comments), lost=progress.lost,
        )  # fmt: skip
