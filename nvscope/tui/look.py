"""Look: what all views of the screen show at one moment, and how."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any

from msgspec import Struct, field

from nvscope.analysis.recent_frames import FoundFrames
from nvscope.analysis.watching import Scene
from nvscope.causes.cause import Cause
from nvscope.causes.chronicle import Chronicle
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.summary import ListSummary
from nvscope.view.escape import visible_document
from nvscope.view.lines.plant.content import Clock, node_names
from nvscope.view.lines.plant.happenings import Concern, concerns

STRIP_NS = 120_000_000_000
"""Strips show two minutes of what is live, and the whole of a capture."""


class Choice(Struct, frozen=True):
    """The filter that is in force: its expression, and the keys of the lists that chosen frames belong to.

    ``lists`` is None as long as nobody has looked yet. ``suspended``: it is known, and chooses nothing now.
    """

    expression: str
    lists: Collection[str] | None = None
    suspended: bool = False


class Look(Struct, frozen=True, dict=True):
    """A scene, and how it is shown: ``utc`` times, a filter, ``live`` where time goes on by itself.

    ``at_ns`` is the moment that a person went to, None for what is now. ``frozen`` is what is shown while time goes on.
    ``found`` are the frames to be shown, as far as the ring was looked at; None where nobody has looked yet.
    """

    scene: Scene
    utc: bool = False
    choice: Choice | None = None
    live: bool = True
    at_ns: int | None = None
    frozen: bool = False
    found: FoundFrames | None = None
    report: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def of(scene: Scene, **how: Any) -> Look:
        """Return a look whose report is safe to be shown: every text from outside is visible."""
        return Look(scene, report=visible_document(scene.document), **how)

    @property
    def now_ns(self) -> int:
        """The time up to which the source was watched."""
        return self.scene.at_ns or 0

    @cached_property
    def clock(self) -> Clock:
        """How times are told."""
        return Clock.of(self.report, utc=self.utc)

    @cached_property
    def entries(self) -> Sequence[CanListSummary | ListSummary]:
        """The lists, in the order of the report's."""
        summary = self.scene.snapshot.summary
        return (*summary.can.lists, *summary.lists)

    @cached_property
    def causes(self) -> Sequence[Cause]:
        """The causes, in the order of the report's."""
        happened = self.scene.snapshot.happened
        return happened.causes if happened else ()

    @cached_property
    def concerns(self) -> Mapping[str, Concern]:
        """What happened to the lists that causes concern, by key, in the order of the causes."""
        return concerns(self.report)

    @cached_property
    def chronicle(self) -> Chronicle | None:
        """What strips are drawn from."""
        chronicle = self.scene.chronicle
        return chronicle.last(STRIP_NS) if chronicle is not None and self.live else chronicle

    @cached_property
    def nodes(self) -> Mapping[str, str]:
        """The names of the nodes that have one, by address."""
        return node_names(self.report)
