"""What is counted of captures behind the warm-up, of which rules are judged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene
from nvscope.capture.source import Source
from nvscope.check.first_frames import FirstFrames
from nvscope.engine.run import Observer
from nvscope.engine.told import Told
from nvscope.findings.torn_cycles import CycleSizes
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import Summary
from nvscope.tracker.windows import Windows

_FOREVER_NS = 1 << 61


class BehindWarmUp:
    """What is counted behind the warm-up: by a state of its own, or without one by that of all."""

    def __init__(self, inquiry: Inquiry, frames: FirstFrames, since_ns: int | None) -> None:
        self._inquiry = inquiry
        self.since_ns = since_ns
        self.windows = None if since_ns is None else Windows(_FOREVER_NS, since_ns, listeners=(frames,))
        self._before = None if self.windows is None else CyclesBefore(self.windows, since_ns or 0)

    @property
    def observers(self) -> Sequence[Observer]:
        return () if self.windows is None or self._before is None else (self._before, self.windows)

    @property
    def is_ahead(self) -> bool:
        """Whether nothing has come behind the warm-up so far."""
        return self.windows is not None and self.windows.open() is None

    def cut(self, source: Source) -> Source:
        return source if self.windows is None else self.windows.cut(source)

    def summary(self, scene: Scene) -> Summary:
        inquiry, window = self._inquiry, None if self.windows is None else self.windows.open()
        if window is None:
            return scene.snapshot.summary
        return window.counted.summary(
            intervals_ns=inquiry.project.definition.nominal_intervals_ns(), readers=inquiry.project.readers,
            buses=inquiry.project.buses, cob_ids=inquiry.pdos.cob_ids if inquiry.pdos else frozenset(),
        )  # fmt: skip

    def cycles(self, state: TrackerState) -> Callable[[Sequence[int]], tuple[int, int, int] | None]:
        sizes = CycleSizes((self.windows.state if self.windows else state).senders.cycles)
        before = self._before

        def counted(streams: Sequence[int]) -> tuple[int, int, int] | None:
            found = sizes.counted(streams)
            if found is None or before is None:
                return found
            cycles, torn = before.of(streams)
            return found[0] - cycles, found[1] - torn, found[2]

        return counted


class CyclesBefore:
    """Remembers how many cycles there were before a time; it observes in front of the state that counts them."""

    by_stream: ClassVar[bool] = True

    def __init__(self, windows: Windows, since_ns: int) -> None:
        self._windows, self._since_ns = windows, since_ns
        self._sizes: tuple[Any, Any] | None = None

    def observe(self, told: Told) -> None:
        if self._sizes is None and len(told) and int(told.packets.ts_ns.max()) >= self._since_ns:
            counts = self._windows.state.senders.cycles.stream_counts
            self._sizes = counts.cycles.copy(), counts.torn.copy()

    def of(self, streams: Sequence[int]) -> tuple[int, int]:
        """Return cycles and torn ones of the stream that counts for some."""
        if self._sizes is None:
            return 0, 0
        counts = self._windows.state.senders.cycles.stream_counts
        first = min(streams, key=lambda stream: int(counts.last_frame[stream]))
        cycles, torn = self._sizes
        return (int(cycles[first]), int(torn[first])) if first < len(cycles) else (0, 0)
