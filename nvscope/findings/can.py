"""NV603 and NV606: frames that are not as long as their definition says, or as the one before, and error frames."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from dissectors.can_error import CLASSES
from nvscope.definition.pdos import Pdos
from nvscope.findings.finding import Facts, Finding, events_of
from nvscope.tracker.events import FRAMES_KEPT
from nvscope.units import count_of

_LABELS = {bit.mask: bit.label for bit in CLASSES}


def judge_can(facts: Facts) -> Iterator[Finding]:
    """Yield NV603 for each COB-ID whose length changed, and NV606 for each channel with error frames."""
    yield from _lengths(facts)
    yield from _errors(facts)


def _lengths(facts: Facts) -> Iterator[Finding]:
    lengths, pdos = facts.state.can.lengths, Pdos(facts.definition).by_cob_id if facts.definition else {}
    row_of = {stream: row for row, stream in enumerate(lengths.keys.high.tolist())}
    for entry in facts.summary.can.lists:
        for stream in entry.streams:
            pdo = None if stream.extended else pdos.get(stream.cob_id)
            if pdo is not None and pdo.layout is not None:
                told = pdo.layout.layout.size_bytes
                wrong = stream.frames - stream.by_length[told]
                if wrong:
                    message = (
                        f"{count_of(wrong, 'frame')} of {stream.frames} not of {count_of(told, 'byte')}, as the "
                        f"definition has it if packed as assumed; the last one had {count_of(stream.length, 'byte')}."
                    )
                    yield Finding(
                        "NV603", message, wrong, stream.first_ns, stream.last_ns, (), entry.number, None,
                        stream.subindex,
                    )  # fmt: skip
            elif stream.stream in row_of:
                events = events_of(lengths.rows, row_of[stream.stream])
                message = (
                    f"The length of the frames changed {count_of(events.count, 'time')}; "
                    f"the last one had {count_of(stream.length, 'byte')}."
                )
                yield Finding(
                    "NV603", message, events.count, events.first_ns, events.last_ns, events.frames,
                    entry.number, None, stream.subindex,
                )  # fmt: skip


def _errors(facts: Facts) -> Iterator[Finding]:
    errors = facts.state.can.errors
    by_channel = defaultdict(list)
    for row, (channel, mask) in enumerate(zip(errors.keys.high.tolist(), errors.keys.low.tolist(), strict=True)):
        by_channel[channel].append((mask, events_of(errors.rows, row)))
    for channel, classes in sorted(by_channel.items()):
        told = ", ".join(f"{_LABELS.get(mask, hex(mask))} ({events.count})" for mask, events in sorted(classes))
        frames = sorted({frame for _, events in classes for frame in events.frames})[:FRAMES_KEPT]
        most = max(events.count for _, events in classes)
        yield Finding(
            "NV606", f"Channel {facts.summary.can.channel(channel)}: error frames, by what they tell: {told}.", most,
            min(events.first_ns for _, events in classes), max(events.last_ns for _, events in classes), tuple(frames),
        )  # fmt: skip
