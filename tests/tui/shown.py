"""What the screen shows of a capture, as text: the real program without a terminal."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from textual.pilot import Pilot

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Watching
from nvscope.record.recorder import Recorder
from nvscope.tui.actions import Keymap
from nvscope.tui.app import WatchApp
from nvscope.tui.feed import SessionFeed

_PATIENCE_S = 20.0


class Shown:
    """A screen that a test looks at and presses keys of."""

    def __init__(self, app: WatchApp, pilot: Pilot[Any]) -> None:
        self.app, self._pilot = app, pilot

    async def press(self, *keys: str) -> None:
        """Press keys, and wait until what they do is shown."""
        await self._pilot.press(*keys)
        await self._pilot.pause()

    async def until(self, found: Callable[[], bool]) -> None:
        """Wait until something is so."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_PATIENCE_S):
                while not found():
                    await self._pilot.pause(0.02)
        assert found(), self.text()

    def lines(self) -> list[str]:
        """Return the lines of the screen, without what is empty at their ends."""
        strips = self.app.screen._compositor.render_strips()
        return ["".join(segment.text for segment in strip).rstrip() for strip in strips]

    def text(self) -> str:
        return "\n".join(self.lines())


def on_screen(
    inquiry: Inquiry, look_at: Callable[[Shown], Any], size: tuple[int, int] = (80, 24), keys: Sequence[str] = ()
) -> None:  # fmt: skip
    """Show captures, wait until all was read, press keys, and call an asynchronous function that looks at it."""

    async def run() -> None:
        how = Watching()
        feed = SessionFeed(inquiry, how)
        app = WatchApp(feed, Keymap(), recorder=Recorder(), theme="dark", utc=True)
        try:
            async with app.run_test(size=size) as pilot:
                shown = Shown(app, pilot)
                await shown.until(lambda: app._ended and app.look is not None and app.look.scene.at_ns is not None)
                await shown.press(*keys)
                await look_at(shown)
        finally:
            feed.stop()

    asyncio.run(run())
