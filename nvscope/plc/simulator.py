"""Simulator: from a scenario to frames and to the truth about them.

The same scenario gives the same bytes on every machine. Frames are rendered in batches; what stays in memory is the
timeline.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from dissectors.batch import PacketBatch
from nvscope.capture.source import Sink
from nvscope.plc.frames import render
from nvscope.plc.ordering import order_by
from nvscope.plc.scenario import Scenario
from nvscope.plc.timeline import LINKS, Timeline, make_timeline
from nvscope.plc.truth import make_truth

BATCH_FRAMES = 32_768


def simulate(
    scenario: Scenario,
    sink: Sink,
    *,
    batch_frames: int = BATCH_FRAMES,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Write the traffic of a scenario to a sink, and return the truth about it (``nvscope.truth/1``).

    The sink stays open. ``progress`` is told frames written and frames in all after each batch. Raises
    ConfigurationError before anything is written where faults of the scenario contradict each other.
    """
    timeline = make_timeline(scenario)
    truth = make_truth(scenario, timeline)
    written = 0
    for batch in packets(timeline, int(LINKS[scenario.link]), batch_frames):
        sink.write(batch)
        written += len(batch)
        if progress is not None:
            progress(written, len(timeline))
    return truth


def packets(timeline: Timeline, link: int, batch_frames: int = BATCH_FRAMES) -> Iterator[PacketBatch]:
    """Yield the frames of a timeline, rendered; the bytes of a batch stand in it grouped by template."""
    for start in range(0, len(timeline), batch_frames):
        yield _rendered(timeline, slice(start, min(start + batch_frames, len(timeline))), link)


def _rendered(timeline: Timeline, rows: slice, link: int) -> PacketBatch:
    template = timeline.template[rows]
    order = order_by(template)
    numbers, starts = np.unique(template[order], return_index=True)
    stops = np.append(starts[1:], len(order))
    sizes = np.array([len(timeline.templates[number].frame.data) for number in numbers.tolist()], np.int64)
    data = np.empty(int((sizes * (stops - starts)).sum()), np.uint8)
    offset = np.empty(len(order), np.int64)
    ordinal = timeline.ordinal[rows].astype(np.int64)
    counter, flags, checksum = timeline.counter[rows], timeline.flags[rows], timeline.checksum[rows]
    end = 0
    for number, first, last, size in zip(
        numbers.tolist(), starts.tolist(), stops.tolist(), sizes.tolist(), strict=True
    ):
        own = order[first:last]
        begin, end = end, end + size * len(own)
        out = data[begin:end].reshape(len(own), size)
        render(timeline.templates[number].frame, ordinal[own], counter[own], flags[own], checksum[own], out)
        offset[own] = begin + size * np.arange(len(own))
    original = np.empty(len(order), np.int64)
    original[order] = np.repeat(sizes, stops - starts)
    return PacketBatch(
        data, offset, timeline.captured[rows], original, timeline.ts_ns[rows], PacketBatch.link_column(link, len(order))
    )
