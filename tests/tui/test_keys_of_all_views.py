"""What all views share: the line below, the tabs, help and explanations, freezing, and leaving while recording."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.record.recorder import Recorder, Recording
from nvscope.tui.actions import Keymap
from nvscope.tui.bars import Tabs, foot
from tests.tui.screen import Screen, on_screen

PLANT = str(Path(__file__).parents[2] / "captures" / "plant.pcapng.gz")
HINTS = ("time.freeze", "find.filter", "show.sort", "view.open")


def words(line: Any) -> str:
    return "".join(cell.text for cell in line)


@pytest.mark.parametrize("width", [20, 40, 60, 80, 160])
def test_what_is_in_force_is_told_before_what_keys_do(width: int) -> None:
    left, right = foot(Keymap(), HINTS, ["/nv.index == 9", "R 12 kB", "live"], width)
    assert len(words(left)) + len(words(right)) <= width
    if width >= 40:
        assert words(right).strip() == "/nv.index == 9   R 12 kB   live"
    if width >= 60:
        assert "? keys" in words(left)
    assert ("s sort" in words(left)) == (width >= 160)


@pytest.mark.parametrize("width", [12, 20, 30, 45, 80, 160])
def test_what_is_broken_is_told_at_the_top_of_every_terminal(width: int) -> None:
    async def look(screen: Screen) -> None:
        await screen.resize(width, 20)
        await screen.until(lambda: "✗ 2 now" in screen.lines[0])
        assert (".gz" in screen.lines[0]) == (width >= 20)
        assert ("00:00:29" in screen.lines[0]) == (width >= 45)
        assert ("nvscope" in screen.lines[0]) == (width >= 45)

    on_screen(Inquiry([PLANT]), look)


def test_a_filter_is_seen_on_a_small_terminal_and_holds_for_what_happened_too() -> None:
    async def look(screen: Screen) -> None:
        screen.app.act("find.filter", "nv.index == 9")
        await screen.until(lambda: "/nv.index == 9" in screen.lines[-1])
        await screen.until(lambda: "192.168.1.99" not in screen.text)
        assert "started anew" in screen.text
        await screen.press("backslash")
        await screen.until(lambda: "/nv.index == 9 (off)" in screen.lines[-1])
        assert "192.168.1.99" in screen.text

    on_screen(Inquiry([PLANT]), look, size=(80, 24))


def test_whoever_leaves_the_help_is_where_the_help_was_asked_for() -> None:
    async def look(screen: Screen) -> None:
        for name, shown in (("program.help", "page"), ("show.explain", "NV301 no-acknowledgement")):
            await screen.press("3")
            screen.app.act(name, "NV301" if name == "show.explain" else "")
            await screen.press()
            assert shown in screen.text
            assert screen.app.front is None
            await screen.press("q")
            assert screen.app.front is screen.app.views[2]
        screen.app.act("show.explain", "second-sender")
        await screen.press()
        assert "second-sender" in screen.lines[2]

    on_screen(Inquiry([PLANT]), look, size=(80, 24))


def test_for_how_long_it_stands_still_is_told_while_it_does() -> None:
    async def look(screen: Screen) -> None:
        def frozen_s() -> int:
            told = re.search(r"frozen (\d+) s", screen.lines[-1])
            return int(told[1]) if told else -1

        await screen.press("space")
        # Each number stands for a second only, in which a busy machine may not look.
        await screen.until(lambda: frozen_s() >= 1)
        before_s = frozen_s()
        await screen.until(lambda: frozen_s() > before_s)

    on_screen(Inquiry([PLANT]), look, size=(80, 24))


def test_q_does_not_end_a_recording_by_the_way() -> None:
    class Records(Recorder):
        state = Recording("night.pcapng")

    async def look(screen: Screen) -> None:
        screen.app._records.recorder = Records()
        await screen.press("q")
        await screen.until(lambda: "Recording to night.pcapng: ctrl-q ends it" in " ".join(screen.text.split()))
        assert screen.app._exit is False

    on_screen(Inquiry([PLANT]), look, size=(120, 24), notes=True)


def test_tabs_have_the_keys_that_views_have() -> None:
    keys = Keymap({"view.causes": "c"})
    tabs = Tabs(["Lists", "Causes"], [keys.key_of(name) or "" for name in ("view.lists", "view.causes")])
    assert tabs._told == ["1 Lists", "c Causes"]


def test_escape_leads_back_and_never_out() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("question_mark", "escape")
        assert screen.app.front is screen.app.views[0]
        await screen.press("2", "escape", "escape", "escape")
        assert screen.app.front is screen.app.views[0]
        assert screen.app._running
        await screen.press("q")
        assert screen.app._exit

    on_screen(Inquiry([PLANT]), look)


def test_what_is_told_gives_way_to_what_is_told_next_and_errors_stay() -> None:
    async def look(screen: Screen) -> None:
        screen.app.notify("the disk is full", severity="error", timeout=60)
        for theme in ("nothing", "of this name", "is there"):
            screen.app.act("show.theme", theme)
        await screen.until(lambda: len(screen.app._notifications) == 2)
        first, last = screen.app._notifications
        assert (first.severity, last.severity) == ("error", "warning")

    on_screen(Inquiry([PLANT]), look, notes=True)


def test_a_list_is_opened_as_what_is_known_of_it_and_a_key_without_use_is_told_by_its_name() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("enter")
        assert screen.app.front is screen.app.views[3]  # no definition: its telegrams
        await screen.press("5", "x")
        await screen.until(lambda: [one.message for one in screen.app._notifications] == ["x does nothing in Nodes"])

    on_screen(Inquiry([PLANT]), look, notes=True)
