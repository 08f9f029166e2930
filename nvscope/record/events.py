"""Events that show when a plant is judged: causes and findings of which an expression becomes true."""

from __future__ import annotations

from collections.abc import Hashable, Iterator

from nvscope.analysis.news import identity_of
from nvscope.analysis.watching import Scene
from nvscope.errors import UsageError
from nvscope.list_key import ListKey
from nvscope.record.flight_recorder import slug_of
from nvscope.tracker.figures import BY_NAME, Of
from nvscope.tracker.frame_counts import STEPS
from nvscope.units import list_key
from nvscope.view.fields.shown_fields import CAUSE, FINDING
from nvscope.view.moment_filter import MomentFilter

Event = tuple[int, str, str]
"""When it began, what it is for the name of a file, and what is told of it."""


def is_of_scenes(chosen: MomentFilter) -> bool:
    """Tell whether an expression asks for causes and findings, and not for what telegrams say.

    UsageError where it asks for both, or for what is known at the end of a capture only.
    """
    judged = [field.name for field in chosen.named if field.judged]
    if not judged:
        return False
    others = [name for name in judged if not name.startswith((CAUSE, FINDING))]
    if others:
        raise UsageError(
            f"{', '.join(others)}: known of a whole capture, and not of a single frame",
            next_step=f"a frame counts by itself {', '.join(_of_frames())}; else wait for the finding that tells it, "
            "such as --trigger 'finding.code == \"NV501\"'",
        )
    if chosen.alone is None:
        raise UsageError(
            "causes and findings begin by themselves: rose, held and the like are of telegrams",
            next_step="leave them out: an event is where a cause or a finding begins",
        )
    if not chosen.alone.of_any_frame:
        raise UsageError(
            "causes and findings are told of a plant, the rest of single telegrams: a trigger waits for one of both",
            next_step="leave one of them out",
        )
    return True


def _of_frames() -> list[str]:
    return [f"list.{figure}" for figure in STEPS if Of.LIST in BY_NAME[figure].of]


class EventsOfScenes:
    """Tells from scene to scene which causes and findings are new of those that an expression chooses."""

    def __init__(self, expression: str) -> None:
        self._expression = expression
        self._known: set[Hashable] = set()

    def new(self, scene: Scene) -> Iterator[Event]:
        """Yield what an expression is true of that it was not true of before."""
        happened, at_ns = scene.snapshot.happened, scene.at_ns
        if happened is None or at_ns is None:
            return
        chosen = scene.filter(self._expression)
        findings, causes = chosen.shown()
        if chosen.causes:
            for number in sorted(causes):
                cause = happened.causes[number]
                if self._is_new(identity_of(cause)):
                    since_ns = at_ns if cause.since_ns is None else cause.since_ns
                    yield since_ns, slug_of(cause.kind.name, [_name(key) for key in cause.lists]), cause.title
            return
        for number in sorted(findings):
            finding = scene.snapshot.findings[number]
            if self._is_new(finding.place):
                since_ns = at_ns if finding.first_ns is None else finding.first_ns
                yield since_ns, f"{finding.code}-{finding.kind.name}", finding.message

    def _is_new(self, identity: Hashable) -> bool:
        known = identity in self._known
        self._known.add(identity)
        return not known


def _name(key: ListKey) -> str:
    """Return what people call a list: 7, on CAN 0x181."""
    return list_key(str(key)).rpartition("/")[2]
