"""Tests of what still comes while the screen is taken down: it is not shown, and ends nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from tests.tui.screen import Screen, on_screen

PLANT = Path(__file__).parents[2] / "captures" / "plant.pcapng.gz"


@pytest.mark.parametrize("gone", ["#head", "#foot", "#views"])
def test_what_comes_too_late_is_not_shown(gone: str) -> None:
    async def take_down(screen: Screen) -> None:
        app = screen.app
        await app.query(gone).remove()
        draws = app.draws
        # As the feed, a search and timers do, each from its thread or at its time.
        app.end(None)
        app.take_found()
        app.take_past(app.look.scene if app.look else None)  # type: ignore[arg-type]
        app.draw()
        await screen.pause(0.2)
        assert app.draws == draws

    on_screen(Inquiry([str(PLANT)]), take_down)
