"""Simulator: from a scenario to frames and to the truth about them.

The same scenario gives the same bytes on every machine. Frames are rendered in batches; what stays in memory is their
table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dissectors.batch import Bool, PacketBatch
from nvscope.capture.formats import suffixes_that, written_as
from nvscope.capture.open import open_sink
from nvscope.capture.pcapng.sink import PcapngSink
from nvscope.capture.source import Sink
from nvscope.errors import CaptureError, UsageError
from nvscope.simulate.can.frame_table import CanFrameTable
from nvscope.simulate.can.tables import ETHERNET
from nvscope.simulate.frame_table import FrameTable
from nvscope.simulate.frames import LINKS, render
from nvscope.simulate.ordering import order_by
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_facts import make_scenario_facts
from nvscope.simulate.truth import make_truth

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
    facts = make_scenario_facts(scenario)
    truth = make_truth(facts)
    table, can = facts.table, facts.can_table
    del facts  # what is known of frames takes memory
    written = 0
    for batch in all_packets(scenario, table, can, batch_frames):
        sink.write(batch)
        written += len(batch)
        if progress is not None:
            progress(written, truth["capture"]["frames"])
    return truth


def traffic(scenario: Scenario, batch_frames: int = BATCH_FRAMES) -> Iterator[PacketBatch]:
    """Yield the frames of a scenario in the order of time; ConfigurationError as ``simulate``, when it is called."""
    facts = make_scenario_facts(scenario)
    return all_packets(scenario, facts.table, facts.can_table, batch_frames)


def open_capture(scenario: Scenario, path: str, name: str) -> Sink:
    """Return a sink for the traffic of a scenario at ``path``; messages call it ``name``.

    Raises UsageError where the format cannot hold what is in the scenario.
    """
    suffix = Path(name).suffix.lower()
    known = written_as(name)
    if scenario.has_network and scenario.channels and not (known and known.mixes_links):
        raise UsageError(
            f"the scenario has frames of CAN and others, which a {suffix} file cannot hold side by side", where=name,
            next_step=f"name the file {suffixes_that(lambda one: one.mixes_links)}",
        )  # fmt: skip
    if known and len(scenario.channels) > 1 and not known.names_channels:
        raise UsageError(
            f"the scenario has {len(scenario.channels)} CAN buses, which a {suffix} file cannot tell apart", where=name,
            next_step=f"name the file {suffixes_that(lambda one: one.names_channels)}",
        )  # fmt: skip
    if known and scenario.has_network and known.only_can:
        raise UsageError(
            f"the scenario has no frames of CAN, and a {known.name} log holds no others", where=name,
            next_step=f"name the file {suffixes_that(lambda one: not one.only_can)}",
        )  # fmt: skip
    drops = sum(loss.drops for loss in scenario.capture_loss)
    if drops and known and known.name != PcapngSink.format_name:
        raise UsageError(
            f"the scenario's capture says that it dropped frames, which a {suffix} file cannot say", where=name,
            next_step="name the file .pcapng",
        )  # fmt: skip
    try:
        sink = open_sink(path, channels_of(scenario) or None)
    except (CaptureError, UsageError) as error:
        error.where = name
        raise
    if isinstance(sink, PcapngSink):
        sink.drops = drops
    return sink


def channels_of(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the channels of a scenario's packets, by number; none where there is no CAN."""
    if not scenario.channels:
        return ()
    return ((ETHERNET,) if scenario.has_network else ()) + scenario.channels


def all_packets(
    scenario: Scenario, table: FrameTable | None, can: CanFrameTable | None, batch_frames: int = BATCH_FRAMES
) -> Iterator[PacketBatch]:
    """Yield the frames of a scenario's buses and of its network in the order of time."""
    link = int(LINKS[scenario.link])
    if can is None:
        yield from packets(table, link, batch_frames) if table is not None else ()
        return
    if table is None:
        for start in range(0, len(can), batch_frames):
            yield can.frames.take(slice(start, start + batch_frames)).packets()
        return
    is_can = np.repeat([False, True], [len(table), len(can)])
    is_can = is_can[np.argsort(np.concatenate([table.ts_ns, can.frames.ts_ns]), kind="stable")]
    here = there = 0
    for start in range(0, len(is_can), batch_frames):
        of_can = is_can[start : start + batch_frames]
        frames = int(of_can.sum())
        others = len(of_can) - frames
        yield interleaved(
            _rendered(table, slice(here, here + others), link),
            can.frames.take(slice(there, there + frames)).packets(first_channel=1),
            of_can,
        )
        here, there = here + others, there + frames


def interleaved(first: PacketBatch, second: PacketBatch, is_second: Bool) -> PacketBatch:
    """Return the packets of two batches as one, in the order that ``is_second`` tells, of shape (n,)."""
    order = np.empty(len(is_second), np.int64)
    order[~is_second] = np.arange(len(first))
    order[is_second] = np.arange(len(first), len(first) + len(second))
    offset = np.concatenate([first.offset, second.offset + len(first.data)])[order]
    captured, original, ts_ns, link, channel = (
        np.concatenate([getattr(first, name), getattr(second, name)])[order]
        for name in ("captured", "original", "ts_ns", "link", "channels")
    )
    return PacketBatch(np.concatenate([first.data, second.data]), offset, captured, original, ts_ns, link, channel)


def packets(table: FrameTable, link: int, batch_frames: int = BATCH_FRAMES) -> Iterator[PacketBatch]:
    """Yield the frames of a scenario, rendered; the bytes of a batch stand in it grouped by template."""
    for start in range(0, len(table), batch_frames):
        yield _rendered(table, slice(start, min(start + batch_frames, len(table))), link)


def _rendered(table: FrameTable, rows: slice, link: int) -> PacketBatch:
    template = table.template[rows]
    order = order_by(template)
    numbers, starts = np.unique(template[order], return_index=True)
    stops = np.append(starts[1:], len(order))
    sizes = np.array([len(table.templates[number].frame.data) for number in numbers.tolist()], np.int64)
    data = np.empty(int((sizes * (stops - starts)).sum()), np.uint8)
    offset = np.empty(len(order), np.int64)
    ordinal = table.ordinal[rows].astype(np.int64)
    counter, flags, checksum = table.counter[rows], table.flags[rows], table.checksum[rows]
    end = 0
    for number, first, last, size in zip(
        numbers.tolist(), starts.tolist(), stops.tolist(), sizes.tolist(), strict=True
    ):
        own = order[first:last]
        begin, end = end, end + size * len(own)
        out = data[begin:end].reshape(len(own), size)
        render(table.templates[number].frame, ordinal[own], counter[own], flags[own], checksum[own], out)
        offset[own] = begin + size * np.arange(len(own))
    original = np.empty(len(order), np.int64)
    original[order] = np.repeat(sizes, stops - starts)
    return PacketBatch(
        data, offset, table.captured[rows], original, table.ts_ns[rows], PacketBatch.link_column(link, len(order))
    )
