"""What is counted of captures behind the warm-up, of which rules are judged."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any, ClassVar

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene
from nvscope.engine.told import Told
from nvscope.findings.torn_cycles import CycleSizes
from nvscope.tracker.since import Since
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import Summary


class BehindWarmUp:
    """What one state has counted behind the warm-up, or all of it where there is none."""

    by_stream: ClassVar[bool] = True

    def __init__(self, inquiry: Inquiry, state: TrackerState, since: Since | None) -> None:
        self._inquiry, self._state, self._since = inquiry, state, since
        self.since_ns = None if since is None else since.start_ns
        self._cycles_before: tuple[Any, Any] | None = None

    @property
    def is_ahead(self) -> bool:
        """Whether nothing has come behind the warm-up so far."""
        return self._since is not None and not self._since.has_begun

    def observe(self, told: Told) -> None:
        """Take a batch that the state has taken."""
        if self._since is None:
            return
        was_ahead = self.is_ahead
        self._since.observe(told)
        if was_ahead and not self.is_ahead:
            counts = self._state.senders.cycles.stream_counts
            self._cycles_before = counts.cycles.copy(), counts.torn.copy()

    @contextmanager
    def as_of_all(self) -> Iterator[None]:
        """Let the state have the extremes of all that it has counted."""
        with nullcontext() if self._since is None else self._since.as_of_all():
            yield

    def summary(self, scene: Scene) -> Summary:
        """Return what is known behind the warm-up; before that is over, of all."""
        inquiry = self._inquiry
        if self._since is None or self.is_ahead:
            return scene.snapshot.summary
        return self._since.counted().summary(
            intervals_ns=inquiry.project.definition.nominal_intervals_ns(), readers=inquiry.project.readers,
            buses=inquiry.project.buses, cob_ids=inquiry.pdos.cob_ids if inquiry.pdos else frozenset(),
        )  # fmt: skip

    def cycles(self) -> Callable[[Sequence[int]], tuple[int, int, int] | None]:
        """Return what tells of the streams of a list how many whole cycles there were, torn ones, and their skew."""
        sizes = CycleSizes(self._state.senders.cycles)

        def counted(streams: Sequence[int]) -> tuple[int, int, int] | None:
            found = sizes.counted(streams)
            if found is None or self._cycles_before is None:
                return found
            counts = self._state.senders.cycles.stream_counts
            # Of several streams, one counts for all.
            first = min(streams, key=lambda stream: int(counts.last_frame[stream]))
            cycles, torn = (int(one[first]) if first < len(one) else 0 for one in self._cycles_before)
            return found[0] - cycles, found[1] - torn, found[2]

        return counted
