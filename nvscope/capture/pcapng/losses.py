"""What a pcapng file says was lost while capturing: by statistics of interfaces, and by packets themselves."""

from __future__ import annotations

from collections import Counter

import numpy as np

from dissectors.batch import I64
from nvscope.capture.pcapng.interfaces import MOST_SPANS, Interface
from nvscope.capture.source import LostSpan


class Losses:
    """The packets that were lost up to here; those of sections that are over are kept apart from their interfaces."""

    def __init__(self) -> None:
        self._drops = 0
        self._drops_by: Counter[str] = Counter()
        self._spans: list[LostSpan] = []
        self._told: list[tuple[I64, I64]] = []
        self._last_ns: int | None = None

    def note(self, row: I64, drops: I64) -> None:
        """Note of packets of a stretch, by row, how many their interface lost since the one before."""
        if drops.any():
            self._told.append((row[drops > 0], drops[drops > 0]))

    def settle(self, interfaces: list[Interface], interface: I64, ts_ns: I64) -> None:
        """Take what was noted of a stretch whose packets are of these interfaces and have these times."""
        told, self._told = self._told, []
        last_ns = self._last_ns
        if len(ts_ns):
            self._last_ns = int(ts_ns[-1])
        if not told:
            return
        order = np.argsort(interface, kind="stable")
        before = np.full(len(interface), -1)
        again = interface[order][1:] == interface[order][:-1]
        before[order[1:][again]] = order[:-1][again]
        for row, drops in told:
            for number in np.unique(interface[row]).tolist():
                own, of = interfaces[number], np.flatnonzero(interface[row] == number)
                own.packet_drops += int(drops[of].sum())
                for place in of[: MOST_SPANS - len(own.packet_spans)].tolist():
                    at, previous = int(row[place]), int(before[row[place]])
                    # Of several interfaces, nobody remembers when each had its last packet.
                    since_ns = last_ns if len(interfaces) == 1 else None
                    since_ns = int(ts_ns[previous]) if previous >= 0 else since_ns
                    own.packet_spans.append(LostSpan(since_ns, int(ts_ns[at]), int(drops[place]), at_packet=True))

    def close(self, interfaces: list[Interface]) -> None:
        """Keep what interfaces have lost whose section is over."""
        self._spans = list(self.spans(interfaces))
        self._drops, self._drops_by = self.counted(interfaces)

    def counted(self, interfaces: list[Interface]) -> tuple[int, Counter[str]]:
        """Return how many packets were lost up to here, and where as far as statistics tell."""
        total, parts = self._drops, self._drops_by.copy()
        for one in interfaces:
            total += one.drops
            parts.update(one.statistics_drops or {})
        return total, parts

    def spans(self, interfaces: list[Interface]) -> tuple[LostSpan, ...]:
        """Return when they were lost, as far as the file tells."""
        return (*self._spans, *(span for one in interfaces for span in one.spans))[:MOST_SPANS]
