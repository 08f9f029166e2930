"""What a capture makes of the frames of a connection: some are missing, twice there, late, or cut."""

from __future__ import annotations

import random
from dataclasses import dataclass, fields

from tests.oracle.frame import Frame
from tests.oracle.tcp import peel_tcp
from tests.oracle.tcp_line import Line, snapped


@dataclass(frozen=True)
class Faults:
    """How likely each fault is; per frame, or per connection where it says so."""

    lost: float = 0
    twice: float = 0
    late: float = 0
    snapped: float = 0
    overlap: float = 0
    altered: float = 0
    stray: float = 0
    begun_before: float = 0
    """Per connection."""
    one_sided: float = 0
    """Per connection."""

    @staticmethod
    def drawn(rng: random.Random) -> Faults:
        """Return faults of which some are never, some seldom and some frequent."""
        return Faults(**{one.name: rng.choice((0, 0, 0, 0.01, 0.01, 0.04, 0.12)) for one in fields(Faults)})


def captured(rng: random.Random, faults: Faults, line: Line) -> list[Frame]:
    """Return the frames of a connection as they were captured, in the order in which they came."""
    frames = list(line.frames)
    if rng.random() < faults.begun_before:
        frames = frames[rng.randint(1, max(1, min(12, len(frames) - 1))) :]
    if rng.random() < faults.one_sided:
        side = rng.choice(list(line.ends.values()))
        segments = [(frame, peel_tcp(frame)) for frame in frames]
        frames = [frame for frame, one in segments if one and (str(one.source), one.source_port) != side]
    found: list[Frame] = []
    for frame in frames:
        if rng.random() < faults.lost:
            continue
        segment = peel_tcp(frame)
        cut = segment is not None and segment.length and rng.random() < faults.snapped
        seen = snapped(frame, rng.randint(1, segment.length)) if segment and cut else frame
        found += [seen, seen] if rng.random() < faults.twice else [seen]
    for at in range(len(found)):
        if rng.random() < faults.late:
            to = min(len(found) - 1, at + rng.randint(1, 4))
            found.insert(to, found.pop(at))
    times = sorted(frame.ts_ns for frame in found)
    return [frame._replace(ts_ns=time) for frame, time in zip(found, times, strict=True)]
