"""Which moment is shown: what is now, what was when somebody froze it, or a time that was gone to."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from nvscope.errors import NvscopeError
from nvscope.tui.actions import ACTIONS, Group
from nvscope.tui.prompt import Prompt
from nvscope.view.asked_time import Reference, parse_time

if TYPE_CHECKING:
    from nvscope.tui.app import WatchApp

_FILE_STEPS = 40
_LIVE_STEP_NS = 5_000_000_000


class TimeCommands:
    """The actions of time; ``at_ns`` is the moment that was gone to, None for what is now."""

    def __init__(self, app: WatchApp) -> None:
        self._app = app
        self.frozen = False
        self.at_ns: int | None = None
        self._frozen_s = 0.0

    @property
    def follows(self) -> bool:
        """Whether what is now is shown."""
        return not self.frozen and self.at_ns is None

    @property
    def state(self) -> str:
        """What is said of it, "" where what is now is shown."""
        if self.at_ns is not None:
            return "past"
        return f"frozen {time.monotonic() - self._frozen_s:.0f} s" if self.frozen else ""

    @property
    def does(self) -> Mapping[str, Callable[[str], None]]:
        """What is done for each action, with what stands behind its name."""
        return {
            "time.freeze": self._freeze,
            "time.follow": self._follow,
            "time.back": lambda _: self._step(-1),
            "time.forward": lambda _: self._step(1),
            "time.previous-finding": lambda _: self._to_cause(-1),
            "time.next-finding": lambda _: self._to_cause(1),
            "time.go": self._go_to,
            "time.go-to-ns": lambda told: self._go(int(told)),
            **dict.fromkeys((action.name for action in ACTIONS if action.group is Group.REPLAY), self._not_played),
        }

    def _not_played(self, _: str) -> None:
        self._app.notify("Nothing is played here: `nvscope replay` plays captures", timeout=3)

    def _freeze(self, _: str) -> None:
        self.frozen = not self.frozen
        self._frozen_s = time.monotonic()
        if self.follows:
            self._app.draw()

    def _follow(self, _: str) -> None:
        self.frozen, self.at_ns = False, None
        if self._app.front is not None:
            self._app.front.act("time.follow")
        self._app.draw()

    def _go_to(self, told: str) -> None:
        span = self._app.feed.span()
        if not told or span is None:
            self._app.query_one(Prompt).open(":", "time.go ")
            return
        try:
            asked = parse_time("time.go", told, utc=self._app.utc, frames=False)
        except NvscopeError as error:
            self._app.complain(error)
            return
        assert asked.reference is not Reference.FRAME
        self._go(asked.absolute_ns(span.start_ns, span.end_ns, utc=self._app.utc))

    @property
    def _now_ns(self) -> int | None:
        """The moment that is shown."""
        look = self._app.look
        return self.at_ns if self.at_ns is not None or look is None else look.now_ns

    def _step(self, direction: int) -> None:
        span, now_ns = self._app.feed.span(), self._now_ns
        if span is None or now_ns is None:
            return
        step_ns = _LIVE_STEP_NS if self._app.feed.is_live else max((span.end_ns - span.start_ns) // _FILE_STEPS, 1)
        self._go(now_ns + direction * step_ns)

    def _to_cause(self, direction: int) -> None:
        """Go to when the cause before or behind the moment that is shown began."""
        scene, now_ns = self._app.feed.whole, self._now_ns
        if scene is None and self._app.feed.player is not None:
            self._app.notify("What is to come is still being looked at", timeout=2)
        if scene is None or now_ns is None or scene.snapshot.happened is None:
            return
        begun = sorted({cause.since_ns for cause in scene.snapshot.happened.causes if cause.since_ns is not None})
        found = [time_ns for time_ns in begun if (time_ns > now_ns if direction > 0 else time_ns < now_ns)]
        if not found:
            self._app.notify("No cause began " + ("later" if direction > 0 else "before"), timeout=2)
            return
        self._go(found[0] if direction > 0 else found[-1])

    def _go(self, time_ns: int) -> None:
        """Show a moment; behind the last one, that is what is now."""
        span = self._app.feed.span()
        if span is None:
            return
        if time_ns >= span.end_ns:
            self._follow("")
            return
        self.frozen = False
        self.at_ns = max(time_ns, span.start_ns)
        self._app.feed.at(self.at_ns, self._app.take_past)
