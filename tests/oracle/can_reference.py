"""The rules of diagnosis on CAN, one line of a candump log after the other, in plain integers.

Written to be read, not to be fast. It knows nothing of the simulator: lines of a log and the lists of definitions are
all that goes in.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from tests.oracle.rules.clock import Clock

_LINE = re.compile(r"\((\d+)\.(\d{6}|\d{9})\) (\S+) ([0-9A-F]{3}|[0-9A-F]{8})#(?:(R)(\d?)|(#.)?([0-9A-F]*))")

CANOPEN = (
    (0x000, 0x000), (0x080, 0x0FF), (0x100, 0x100), (0x181, 0x1FF), (0x201, 0x27F), (0x281, 0x2FF), (0x301, 0x37F),
    (0x381, 0x3FF), (0x401, 0x47F), (0x481, 0x4FF), (0x501, 0x57F), (0x581, 0x5FF), (0x601, 0x67F), (0x701, 0x77F),
    (0x7E4, 0x7E5),
)  # fmt: skip

FindingKey = tuple[str, str | None, int | None]


class DefinedList(NamedTuple):
    """A list on CAN as its definition has it: bytes of each PDO, and the interval, None where it is not cyclic."""

    cob_id: int
    sizes: Sequence[int]
    interval_ns: int | None


class Line(NamedTuple):
    """A frame: ``name`` is the identifier as written, three digits or eight."""

    time: int
    channel: str
    name: str
    remote: bool
    size: int


@dataclass
class Stream:
    """The data frames of one identifier of a channel."""

    times: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)


def read(text: str) -> list[Line]:
    lines = []
    for line in text.splitlines():
        match = _LINE.fullmatch(line)
        assert match, line
        seconds, fraction, channel, name, remote, _, _, data = match.groups()
        time = int(seconds) * 10**9 + int(fraction.ljust(9, "0"))
        lines.append(Line(time, channel, name, remote is not None, len(data or "") // 2))
    return lines


def findings(lines: Iterable[Line], lists: Iterable[DefinedList]) -> dict[FindingKey, int]:
    """Return how often each finding is to be found, by code, list and SubIndex."""
    of_cob_id = {}
    for entry in lists:
        for subindex in range(len(entry.sizes)):
            of_cob_id.setdefault(entry.cob_id + subindex, (entry, subindex))
    found: dict[FindingKey, int] = defaultdict(int)
    streams: dict[tuple[str, str], Stream] = defaultdict(Stream)
    pdos: dict[tuple[str, int], list[tuple[int, int]]] = defaultdict(list)
    clock = Clock()
    for line in lines:
        clock.show(line.time)
        if len(line.name) == 8 and int(line.name, 16) & 0x2000_0000:
            found["NV606", None, None] += 1
            continue
        if line.remote:
            continue
        stream = streams[line.channel, line.name]
        stream.times.append(line.time)
        stream.sizes.append(line.size)
        if len(line.name) == 3 and int(line.name, 16) in of_cob_id:
            entry, subindex = of_cob_id[int(line.name, 16)]
            pdos[line.channel, entry.cob_id].append((line.time, subindex))
    for (channel, name), stream in streams.items():
        cob_id = int(name, 16)
        entry, subindex = of_cob_id.get(cob_id, (None, 0)) if len(name) == 3 else (None, 0)
        if entry and any(first <= cob_id <= last for first, last in CANOPEN):
            found["NV602", f"can/{channel}/{entry.cob_id}", None] += len(stream.times)
        number = str(entry.cob_id) if entry else f"{cob_id}x" if len(name) > 3 else str(cob_id)
        where = (f"can/{channel}/{number}", subindex)
        if entry:
            wrong = sum(size != entry.sizes[subindex] for size in stream.sizes)
        else:
            wrong = sum(after != before for before, after in pairwise(stream.sizes))
        found["NV603", *where] += wrong
        for code, count in timing(stream.times, clock.end_of(stream.times[-1]), entry).items():
            found[code, *where] += count
    for (channel, cob_id), seen in pdos.items():
        entry, _ = of_cob_id[cob_id]
        if len(entry.sizes) > 1 and entry.interval_ns:
            found["NV604", f"can/{channel}/{cob_id}", None] += incomplete(seen, entry)
    return {key: count for key, count in found.items() if count}


def timing(times: Sequence[int], end: int, entry: DefinedList | None) -> dict[str, int]:
    intervals = [after - before for before, after in pairwise(times)]
    if not intervals:
        return {}
    ordered = sorted(intervals)

    def percentile(percent: int) -> int:
        return ordered[-(-percent * len(ordered) // 100) - 1]

    p5, median, p95, p99 = (percentile(percent) for percent in (5, 50, 95, 99))
    nominal = entry.interval_ns if entry else None
    if entry is None and len(intervals) >= 5 and median > 0 and 2 * (p95 - p5) <= median:
        nominal = median
    if not nominal:
        return {}
    return {
        "NV501": sum(interval > 2.5 * nominal for interval in intervals),
        "NV502": int(p99 - median > nominal / 2),
        "NV503": sum(0 <= interval < nominal / 10 for interval in intervals),
        "NV504": int(end - times[-1] > 10 * nominal),
    }


def incomplete(seen: Sequence[tuple[int, int]], entry: DefinedList) -> int:
    """Count cycles that are over and have not all PDOs: rising ones within half an interval are one cycle.

    The capture may have begun within the first one, if it is seen from its middle on.
    """
    assert entry.interval_ns
    count, members = 0, len(entry.sizes) if seen[0][1] else 1
    for (before, earlier), (time, subindex) in pairwise(seen):
        if subindex > earlier and 2 * (time - before) <= entry.interval_ns:
            members += 1
            continue
        count += members < len(entry.sizes)
        members = 1
    return count
