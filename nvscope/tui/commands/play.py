"""Where a capture that is played is: stand, go on, step, go to a time or a cause, faster, slower, again and again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from nvscope import units
from nvscope.capture.player import LEAST_RATE, MOST_RATE, Player
from nvscope.tui.commands.time import TimeCommands

if TYPE_CHECKING:
    from nvscope.tui.app import WatchApp

_RATES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_STEP_NS = 5_000_000_000
_LEAST_STEPS = 10
"""A capture has so many steps at least, however short it is."""


class PlayCommands(TimeCommands):
    """The actions of time where a ``player`` plays a capture: what is shown is always where it is."""

    def __init__(self, app: WatchApp, player: Player) -> None:
        super().__init__(app)
        self._player = player

    @property
    def state(self) -> str:
        place = self._player.place
        if place.is_going:
            return "going there"
        return "end" if place.at_end else "paused" if place.paused else ""

    @property
    def does(self) -> Mapping[str, Callable[[str], None]]:
        return {
            **super().does,
            "replay.step": lambda _: self._player.step(1),
            "replay.step-back": lambda _: self._player.step(-1),
            "replay.faster": lambda _: self._change_rate(1),
            "replay.slower": lambda _: self._change_rate(-1),
            "replay.rate": self._set_rate,
            "replay.a-b": self._repeat,
            "replay.loop": self._loop,
        }

    def _freeze(self, _: str) -> None:
        place = self._player.place
        self._player.pause(not (place.paused or place.at_end))

    def _follow(self, _: str) -> None:
        if self._app.front is not None:
            self._app.front.act("time.follow")
        self._player.pause(False)

    @property
    def _now_ns(self) -> int | None:
        at_ns, span = self._player.place.at_ns, self._app.feed.span()
        # Before its first frame it is before everything that happened.
        return at_ns if at_ns is not None or span is None else span.start_ns - 1

    def _step(self, direction: int) -> None:
        span, now_ns = self._app.feed.span(), self._now_ns
        if span is not None and now_ns is not None:
            step_ns = max(min(_STEP_NS, (span.end_ns - span.start_ns) // _LEAST_STEPS), 1)
            self._go(now_ns + direction * step_ns)

    def _go(self, time_ns: int) -> None:
        span = self._app.feed.span()
        if span is not None:
            self._player.go(min(max(time_ns, span.start_ns), span.end_ns))

    def _change_rate(self, direction: int) -> None:
        rate = self._player.place.rate
        others = [one for one in _RATES if (one > rate if direction > 0 else one < rate)]
        if others:
            self._player.set_rate(others[0] if direction > 0 else others[-1])

    def _set_rate(self, told: str) -> None:
        try:
            rate = float(told.rstrip("x×") or 1)
        except ValueError:
            rate = 0.0
        if LEAST_RATE <= rate <= MOST_RATE:
            self._player.set_rate(rate)
        else:
            self._app.notify(f"A rate is {LEAST_RATE} to {MOST_RATE:.0f}", severity="warning", timeout=3)

    def _repeat(self, _: str) -> None:
        """Take where it is for the beginning of what is repeated, then for its end, then for none of it."""
        place, now_ns = self._player.place, self._now_ns
        if now_ns is None:
            return
        if place.a_ns is None or place.b_ns is not None:
            self._player.repeat(None if place.b_ns is not None else now_ns, None)
        elif now_ns == place.a_ns:
            self._app.notify("The end is where the beginning is: let it go on first", timeout=3)
        else:
            self._player.repeat(min(now_ns, place.a_ns), max(now_ns, place.a_ns))
            length = units.duration(abs(now_ns - place.a_ns))
            self._app.notify(f"Repeats {length}; {self._app.keymap.key_of('replay.a-b')} ends that", timeout=3)

    def _loop(self, _: str) -> None:
        loops = not self._player.place.loops
        self._player.loop(loops)
        self._app.notify("Begins again at the end" if loops else "Stands at the end", timeout=2)
