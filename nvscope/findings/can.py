"""NV603: frames that are not as long as their definition says, or as the one before."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.definition.pdos import Pdos
from nvscope.findings.finding import Facts, Finding, events_of
from nvscope.units import count_of


def judge_can(facts: Facts) -> Iterator[Finding]:
    """Yield NV603 for each COB-ID with frames of another length."""
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
