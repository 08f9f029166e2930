"""What is drawn again is what changed: the screen never differs from one that is drawn as a whole."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.cli.definitions import project_of
from nvscope.tui.actions import ACTIONS
from nvscope.tui.own_load import OwnLoadMeter
from nvscope.tui.packets.fields_pane import FieldsPane
from nvscope.view.lines.plant.source_blocks import OwnLoad
from tests.laws import share_of
from tests.tui.screen import Screen, on_screen

CAPTURES = Path(__file__).parents[2] / "captures"
PLANT = str(CAPTURES / "plant.pcapng.gz")
PRESS = str(CAPTURES / "can" / "press.log")
PRESS_GVL = [str(CAPTURES / "can" / "press.gvl")]

NOT_PRESSED = {"program.quit", "program.suspend", "program.command", "find.filter", "show.copy", "time.go"}
PRESSED = [action.name for action in ACTIONS if action.name not in NOT_PRESSED and not action.name.startswith("record")]
MOVES = [name for name in PRESSED if name.startswith(("move.", "time."))]
COMPARED = 160
PATIENCE = 100


def drawn(screen: Screen) -> list[list[tuple[str, Any]]]:
    """Return what is on the screen, with its styles."""
    strips = screen.app.screen._compositor.render_strips()
    return [[(segment.text, segment.style) for segment in strip.simplify()] for strip in strips]


async def settled(screen: Screen) -> list[list[tuple[str, Any]]]:
    """Return what is on the screen when nothing changes any more: panes have their sizes a little later."""
    now = drawn(screen)
    for _ in range(PATIENCE):
        await screen.pause(0.03)
        before, now = now, drawn(screen)
        if before == now:
            break
    return now


@pytest.mark.parametrize(("path", "definitions", "seed"), [(PLANT, None, 1), (PRESS, PRESS_GVL, 2)])
def test_the_screen_is_as_if_drawn_as_a_whole(
    path: str, definitions: list[str] | None, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = random.Random(seed)
    # What the program takes of the machine changes by itself, between one drawing and the next.
    monkeypatch.setattr(OwnLoadMeter, "measure", lambda *_: OwnLoad(5.0, 7.0, 1 << 26, False, 9, 2.0))

    async def try_out(screen: Screen) -> None:
        compared = 0
        while compared < share_of(COMPARED):
            name = chosen.choice(PRESSED if chosen.random() < 0.5 else MOVES)
            if name == "program.back" and screen.app.front is screen.app.views[0]:
                continue
            screen.app.act(name)
            parts = await settled(screen)
            look, found = screen.app.look, screen.app.find.found
            for widget in screen.app.query("*"):
                widget.refresh()
            await screen.press()
            # What a thread found meanwhile is shown, too.
            if look is screen.app.look and found is screen.app.find.found:
                assert drawn(screen) == parts, name
                compared += 1

    on_screen(Inquiry([path], project_of(None, definitions)), try_out, size=(120, 30))


def test_a_terminal_of_another_size_shows_what_one_shows_that_had_it_always() -> None:
    shown: list[list[str]] = []

    async def grow(screen: Screen) -> None:
        shown.append(screen.lines)
        await screen.resize(150, 40)
        await settled(screen)
        shown.append(screen.lines)

    async def keep(screen: Screen) -> None:
        await settled(screen)
        shown.append(screen.lines)

    on_screen(Inquiry([PLANT], project_of(None, None)), grow, size=(80, 24))
    on_screen(Inquiry([PLANT], project_of(None, None)), keep, size=(150, 40))
    assert shown[0] != shown[1] == shown[2]


def test_a_scroll_bar_that_appears_knows_what_was_scrolled_before() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("4")
        fields = screen.app.query_one(FieldsPane)
        await screen.until(lambda: fields.show_vertical_scrollbar)
        await settled(screen)
        assert fields.scroll_offset.y > 0
        assert fields.vertical_scrollbar.position == fields.scroll_offset.y

    on_screen(Inquiry([PLANT], project_of(None, None)), look, size=(80, 24))
