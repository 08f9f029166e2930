"""Stage: what is counted of captures for all rules that are judged from the same time on, and that wait as long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import ClassVar, NamedTuple

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.source import Source
from nvscope.check.answered_while import AnsweredWhile
from nvscope.check.asked_while import AskedWhile
from nvscope.check.behind_warm_up import BehindWarmUp
from nvscope.check.counted_while import CountedWhile
from nvscope.check.cycle_watcher import CycleWatcher
from nvscope.check.figure_windows import FigureWindows
from nvscope.check.first_frames import FirstFrames
from nvscope.check.first_telegrams import FirstTelegrams
from nvscope.check.rules import Rule
from nvscope.check.stream_intervals import IntervalWatcher
from nvscope.check.written_while import WrittenWhile
from nvscope.engine.events import EventListener
from nvscope.engine.run import Observer
from nvscope.engine.told import Told
from nvscope.tracker.since import Since
from nvscope.tracker.state import TrackerState

_OF_ANSWERS = ("acknowledged", "boot_up")


class StageKey(NamedTuple):
    """From when on rules are judged, behind the first frame; and how long answers may take, None for the usual time."""

    warmup_ns: int = 0
    patience_ns: int | None = None


def stage_of(rule: Rule, inquiry: Inquiry) -> StageKey:
    """Return where a rule is judged: one that lets answers take longer than all others do waits by itself."""
    usual_ns = inquiry.timeout_ns or inquiry.project.limits.acknowledgement_ns
    within_ns = (rule.parameters["within"] or 0) if rule.check.name in _OF_ANSWERS else 0
    return StageKey(rule.warmup_ns, within_ns if within_ns > usual_ns else None)


class Stage:
    """The watchers of some rules, and the state that they look at; ``counted`` is what that knows of their time.

    ``observers`` have to observe in their order, on ``cut(source)``, behind the state where that is ``shared``;
    ``listeners`` hear of what that tells.
    """

    def __init__(
        self, inquiry: Inquiry, key: StageKey, since_ns: int | None, watchers: Sequence[Observer], *, shared: bool
    ) -> None:  # fmt: skip
        self.frames, self.telegrams = FirstFrames(since_ns), FirstTelegrams(since_ns)
        figures = [one for one in watchers if isinstance(one, FigureWindows)]
        self._windows = list({id(one.windows): one.windows for one in figures if one.windows is not None}.values())
        counts = list({id(one.counts): one.counts for one in figures if one.counts is not None}.values())
        of_answers = [
            one for one in watchers if isinstance(one, CountedWhile | AnsweredWhile | AskedWhile | WrittenWhile)
        ]
        self._measuring = [one for one in watchers if isinstance(one, IntervalWatcher | CycleWatcher)] + counts
        self.listeners: Sequence[EventListener] = (self.frames, *of_answers, *counts)
        self._inquiry, self._since_ns = inquiry, since_ns
        self._own = None if shared else _OwnState(inquiry.state(listeners=self.listeners), key.patience_ns)
        self.is_shared = shared
        own = [] if self._own is None else [self._own]
        self.observers: list[Observer] = [*own, self.telegrams, *watchers]
        self._since: Since | None = None

    def look_at(self, shared: TrackerState) -> None:
        """Measure by the state that several stages share, unless it has one of its own."""
        self.state = shared if self._own is None else self._own.state
        for one in self._measuring:
            one.state = self.state
        self._since = None if self._since_ns is None else Since(self.state, self._since_ns)
        apart = None if self._own is None else self.state
        self.counted = BehindWarmUp(self._inquiry, self._since, apart)
        self.observers.append(self.counted)

    def cut(self, source: Source) -> Source:
        """Return a source with batches cut where windows and its time begin."""
        for one in self._windows:
            source = one.windows.cut(source)
        return source if self._since is None else self._since.cut(source)


class _OwnState:
    """An observer: a state of its own, which waits for answers as long as it is told to."""

    by_stream: ClassVar[bool] = True

    def __init__(self, state: TrackerState, patience_ns: int | None) -> None:
        self.state, self._patience_ns = state, patience_ns

    def observe(self, told: Told) -> None:
        self.state.observe(told if self._patience_ns is None else told.waiting(self._patience_ns))


@contextmanager
def as_of_all(stages: Sequence[Stage]) -> Iterator[None]:
    """Let the states of stages have the extremes of all that they have counted."""
    with ExitStack() as stack:
        for stage in stages:
            stack.enter_context(stage.counted.as_of_all())
        yield
