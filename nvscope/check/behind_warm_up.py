"""What is counted of captures behind the warm-up, of which rules are judged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import ClassVar

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene
from nvscope.engine.told import Told
from nvscope.tracker.counted import Counted
from nvscope.tracker.since import Since
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import Summary


class BehindWarmUp:
    """What one state has counted behind the warm-up, or all of it where there is none.

    ``apart`` is that state, where it is not the one that scenes show.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, inquiry: Inquiry, since: Since | None, apart: TrackerState | None = None) -> None:
        self._inquiry, self._since, self._apart = inquiry, since, apart
        self.since_ns = None if since is None else since.start_ns

    @property
    def is_ahead(self) -> bool:
        """Whether nothing has come behind the warm-up so far."""
        return self._since is not None and not self._since.has_begun

    def observe(self, told: Told) -> None:
        """Take a batch that the state has taken."""
        if self._since is None:
            return
        self._since.observe(told)

    @contextmanager
    def as_of_all(self) -> Iterator[None]:
        """Let the state have the extremes of all that it has counted."""
        with nullcontext() if self._since is None else self._since.as_of_all():
            yield

    def summary(self, scene: Scene) -> Summary:
        """Return what is known behind the warm-up; before that is over, of all."""
        if self._since is None or self.is_ahead:
            return scene.snapshot.summary if self._apart is None else self._summary(Counted.of(self._apart))
        return self._summary(self._since.counted())

    def _summary(self, counted: Counted) -> Summary:
        inquiry = self._inquiry
        return counted.summary(
            intervals_ns=inquiry.project.definition.nominal_intervals_ns(), readers=inquiry.project.readers,
            buses=inquiry.project.buses, cob_ids=inquiry.pdos.cob_ids if inquiry.pdos else frozenset(),
        )  # fmt: skip
