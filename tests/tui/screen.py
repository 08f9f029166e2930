"""The screen as text: what a person sees of an app in a terminal that Textual's Pilot stands for."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Watching
from nvscope.capture.player import Player
from nvscope.record.recorder import Recorder
from nvscope.tui.actions import Keymap
from nvscope.tui.app import WatchApp
from nvscope.tui.feed import SessionFeed
from nvscope.tui.replay.feed import ReplayFeed

_PATIENCE_S = 100


class Screen:
    """An app that runs, its keys, and the lines that it shows."""

    def __init__(self, app: WatchApp, pilot: Any) -> None:
        self.app, self._pilot = app, pilot

    @property
    def lines(self) -> list[str]:
        """What is shown, from top to bottom, without spaces at the ends."""
        strips = self.app.screen._compositor.render_strips()
        return ["".join(segment.text for segment in strip).rstrip() for strip in strips]

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    async def press(self, *keys: str) -> None:
        """Press keys, one after the other."""
        await self._pilot.press(*keys)
        await self._pilot.pause()

    async def resize(self, width: int, height: int) -> None:
        """Give the terminal another size."""
        await self._pilot.resize_terminal(width, height)
        await self._pilot.pause()

    async def pause(self, time_s: float) -> None:
        """Let some time pass."""
        await self._pilot.pause(time_s)

    async def until(self, shows: Callable[[], object]) -> None:
        """Wait until something is so."""
        end_s = time.monotonic() + _PATIENCE_S
        while not shows():
            assert time.monotonic() < end_s, self.text
            await self._pilot.pause(0.02)


def on_screen(
    inquiry: Inquiry, look: Callable[[Screen], Awaitable[None]], *, size: tuple[int, int] = (80, 24),
    keys: Sequence[str] = (), notes: bool = False, **how: Any,
) -> None:  # fmt: skip
    """Watch captures to their end on a screen of a size, and press keys, and look at it then.

    ``notes`` lie over it where wanted.
    """

    async def watch() -> None:
        feed = SessionFeed(inquiry, Watching())
        app = WatchApp(feed, Keymap(), recorder=Recorder(), utc=True, **how)
        try:
            async with app.run_test(size=size, notifications=notes) as pilot:
                screen = Screen(app, pilot)
                await screen.until(lambda: app._ended and app.look is not None)
                await screen.press(*keys)
                await look(screen)
        finally:
            feed.stop()

    asyncio.run(watch())


def on_replay(
    inquiry: Inquiry, player: Player, look: Callable[[Screen], Awaitable[None]], *,
    size: tuple[int, int] = (100, 30), **how: Any,
) -> None:  # fmt: skip
    """Play captures on a screen of a size, and do with it what is asked for from its beginning on."""

    async def watch() -> None:
        feed = ReplayFeed(inquiry, Watching(), player)
        app = WatchApp(feed, Keymap(), recorder=Recorder(), utc=True, **how)
        try:
            async with app.run_test(size=size) as pilot:
                screen = Screen(app, pilot)
                await screen.until(lambda: app.look is not None and feed.whole is not None)
                await look(screen)
        finally:
            feed.stop()

    asyncio.run(watch())
