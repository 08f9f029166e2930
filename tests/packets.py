"""Frames of tests as packet batches, and what the product makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np

from dissectors.batch import End, PacketBatch
from nvscope.analysis.packets import packets
from nvscope.capture.source import Source, SourceInfo
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.display_filter import DisplayFilter, PacketChoice
from nvscope.view.documents.report import report_document
from nvscope.view.rows.frames import FrameRows, PacketRows
from tests.oracle.frame import Frame
from tests.protocols.rows import logged_of
from tests.records import replace

AnyObserver = TypeVar("AnyObserver", bound=Observer)


def batch_of(frames: Sequence[Frame]) -> PacketBatch:
    """Return frames as one batch over a buffer that ends with the last of them."""
    data = np.frombuffer(b"".join(frame.data for frame in frames), np.uint8)
    captured = np.array([len(frame.data) for frame in frames], np.int64)
    return PacketBatch(
        data,
        np.cumsum(captured) - captured,
        captured.astype(np.int32),
        np.array([frame.original for frame in frames], np.int64),
        np.array([frame.ts_ns for frame in frames], np.int64),
        np.array([frame.link for frame in frames], np.uint16),
        logged=logged_of(frames),
    )


def recorded(*recordings: Sequence[PacketBatch]) -> list[PacketBatch]:
    """Return recordings one behind the other: behind each but the last lies a hole, in which nobody listens."""
    batches: list[PacketBatch] = []
    for number, one in enumerate(recordings):
        if batches:
            batches.append(PacketBatch.ended(End(number - 1, int(batches[-1].ts_ns.max()))))
        batches += (replace(part, source=np.broadcast_to(np.int32(number), len(part))) for part in one)
    return batches


class Batches:
    """A source of given batches."""

    def __init__(self, batches: Iterable[PacketBatch], channels: Sequence[str] = ()) -> None:
        self.batches = batches
        self.infos: list[SourceInfo] = []
        self.channels = channels

    def __iter__(self) -> Iterator[PacketBatch]:
        return iter(self.batches)

    def stop(self) -> None:
        self.batches = ()


def cut(whole: PacketBatch, packets: int) -> list[PacketBatch]:
    """Return a batch as several of so many packets."""
    return [whole[begin : begin + packets] for begin in range(0, len(whole), packets)]


def observed(
    observer: AnyObserver, source: Source | Iterable[PacketBatch], reading: Reading | None = None,
    channels: Sequence[str] = (),
) -> AnyObserver:  # fmt: skip
    """Return an observer after it was told a source, or batches, to the end."""
    for _ in run(source if hasattr(source, "infos") else Batches(source, channels), reading or Reading(), [observer]):
        pass
    return observer


def tracked(source: Source | Iterable[PacketBatch], reading: Reading | None = None) -> TrackerState:
    """Return the state after a source, or some batches."""
    return observed(TrackerState(), source, reading)


class Shown:
    """The rows of a source, as ``nvscope packets`` shows them; iterate once, then ask how many there were."""

    def __init__(
        self, source: Source, reading: Reading | None = None, *, chosen: DisplayFilter | None = None,
        limit: int | None = None,
    ) -> None:  # fmt: skip
        self._source = source
        self._reading = reading or Reading(choose=PacketChoice(chosen) if chosen else None)
        self._rows = PacketRows(limit=limit)

    def __iter__(self) -> Iterator[FrameRows]:
        return packets(self._source, self._reading, self._rows)

    @property
    def counts(self) -> tuple[int, int, int]:
        """Frames and telegrams read, and telegrams shown."""
        return self._rows.frames, self._rows.telegrams, self._rows.shown


def document_of(state: TrackerState) -> dict[str, Any]:
    """Return the report of a state as data, without sources, and without until when they said they were watched."""
    summary = summarize(state)
    document = report_document(summary, judge(state, summary=summary), [])
    document["capture"]["until_ns"] = None
    return document
