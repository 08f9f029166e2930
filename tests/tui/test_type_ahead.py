"""Keys that come faster than the screen: each has its effect behind those before it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from textual import events

from nvscope.analysis.inquiry import Inquiry
from nvscope.tui.prompt import Prompt
from tests.tui.screen import Screen, on_screen

PLANT = str(Path(__file__).parents[2] / "captures" / "plant.pcapng.gz")


def in_one_go(screen: Screen, text: str, *names: str) -> None:
    """Press the keys of a text at once, and some by their names."""
    for char in text:
        screen.app.post_message(events.Key(char, char))
    for name in names:
        screen.app.post_message(events.Key(name, None))


def typed(screen: Screen) -> str:
    return screen.app.query_one(Prompt)._input.value


def test_what_is_typed_in_one_go_is_the_filter() -> None:
    async def look(screen: Screen) -> None:
        in_one_go(screen, "/nv.index == 9", "enter")
        await screen.until(lambda: "/nv.index == 9" in screen.lines[-1])
        assert screen.app.find.state == "/nv.index == 9"

    on_screen(Inquiry([PLANT]), look)


@pytest.mark.parametrize("end", ["enter", "escape"])
def test_keys_behind_a_line_are_for_the_screen(end: str) -> None:
    async def look(screen: Screen) -> None:
        in_one_go(screen, "/nv.index == 9", end)
        in_one_go(screen, "34:", "escape")
        in_one_go(screen, "5")
        await screen.until(lambda: screen.app.front is screen.app.views[4])
        assert not screen.app.query_one(Prompt).is_open
        assert screen.app.find.state == ("/nv.index == 9" if end == "enter" else "")

    on_screen(Inquiry([PLANT]), look)


@pytest.mark.parametrize(
    ("keys", "left"),
    [
        (["a", "b", "left", "c"], "acb"),
        (["a", "b", "backspace", "d"], "ad"),
        (["a", "home", "q"], "qa"),
    ],
)
def test_a_line_is_edited_in_one_go(keys: Sequence[str], left: str) -> None:
    async def look(screen: Screen) -> None:
        for key in ("/", *keys):
            screen.app.post_message(events.Key(key, key if len(key) == 1 else None))
        await screen.until(lambda: typed(screen) == left)
        assert screen.app.query_one(Prompt).is_open

    on_screen(Inquiry([PLANT]), look)


def test_what_is_pasted_stands_in_front_of_what_is_typed_behind_it() -> None:
    async def look(screen: Screen) -> None:
        in_one_go(screen, "/")
        screen.app.post_message(events.Paste("nv.index ==\nrm"))
        in_one_go(screen, " 9", "enter")
        await screen.until(lambda: screen.app.find.state == "/nv.index == 9")

    on_screen(Inquiry([PLANT]), look)


def test_several_lines_one_after_the_other() -> None:
    async def look(screen: Screen) -> None:
        in_one_go(screen, "/nv.index == 9", "enter")
        in_one_go(screen, ":view.packets", "enter")
        in_one_go(screen, "/", "ctrl+u")  # the filter stands there already
        in_one_go(screen, "nv.index == 7", "enter")
        await screen.until(lambda: "/nv.index == 7" in screen.lines[-1])
        assert screen.app.front is screen.app.views[3]

    on_screen(Inquiry([PLANT]), look)
