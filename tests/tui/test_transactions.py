"""The transactions on the screen: who asks whom, what one pair has said, and the packets of that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.tui.bars import Tabs
from nvscope.tui.views.transactions import TransactionsView
from tests.analysis.transactions.talk import ESCAPES, both, visu_talk
from tests.capture.mcap.recordings import Packet, write
from tests.oracle.frame import Frame
from tests.tui.picture import texts_of
from tests.tui.screen import Screen, on_screen

PLANT = str(Path(__file__).parents[2] / "captures" / "plant.pcapng.gz")


def capture(path: Path, frames: list[Frame]) -> Inquiry:
    packets = [Packet(one.data, one.original, one.ts_ns, one.link) for one in frames]
    return Inquiry([str(write(path / "x.pcap", packets))])


def view_of(screen: Screen) -> TransactionsView:
    front = screen.app.front
    assert isinstance(front, TransactionsView)
    return front


def test_who_asks_whom_and_what_that_came_to(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        assert screen.lines[1].endswith("[8 Transactions]")
        assert [" ".join(line.split()) for line in screen.lines[2:5]] == [
            "via asks asked rate requests p50 p99 unanswered refused writes last write ago",
            "✗ sdo 10.0.0.2 10.0.0.5 2.0/s 4 3.0 ms 4.0 ms 1 1 2 refused: … 06 00 → 07 00 2 s",
            "✗ visu 10.0.0.1 10.0.0.5 - 6 1.0 ms 2.0 s 1 1 3 .CurrentPass… → (hidden) 0 s",
        ]
        assert "secret" not in screen.text

    on_screen(capture(tmp_path, both()), look, size=(120, 24), keys=["8"])


def test_a_narrow_terminal_tells_the_two_ways_apart(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        head, *rows = [line.split() for line in screen.lines[2:5]]
        assert head[:4] == ["via", "asks", "asked", "rate"]
        assert [row[1] for row in rows] == ["sdo", "visu"]

    on_screen(capture(tmp_path, both()), look, size=(80, 24), keys=["8"])


def test_a_pair_opens_to_its_last_transactions_and_these_to_their_packets(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        await screen.press("enter")
        title = next(at for at, line in enumerate(screen.lines) if line.startswith("▸"))
        assert screen.lines[title : title + 7] == [
            "▸ 10.0.0.2 → 10.0.0.5:1202  3 replies  p50 3.0 ms, p99 4.0 ms, max 4.0 ms",
            "time                 what                    outcome            took  frame",
            "22:13:22.500  read   0x2000:1 = 06 00        unexpected            -     26",
            "22:13:20.530  read   0x2001:1                unanswered            -     19",
            "22:13:20.024  write  0x2000:1 06 00 → 07 00  refused: Access  4.0 ms     18",
            "22:13:20.012  write  0x2000:1 05 00 → 06 00  confirmed        2.0 ms     12",
            "22:13:20.003  read   0x2000:1 = 05 00        answered         3.0 ms      6",
        ]
        await screen.press("j", "j")
        assert view_of(screen).copied() == "0x2000:1 06 00 → 07 00"
        await screen.press("enter")
        await screen.until(lambda: "Fields   frame 18" in screen.text)
        await screen.press("8", "q")
        assert "▸ 10.0.0.2" not in screen.text
        assert screen.app.front is not screen.app.views[0]
        await screen.press("q")
        assert screen.app.front is screen.app.views[0]

    on_screen(capture(tmp_path, both()), look, size=(80, 30), keys=["8"])


def test_tab_goes_from_pane_to_pane_and_z_shows_one_alone(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        await screen.press("enter", "tab", "j")
        assert "  10.0.0.1 → 10.0.0.5:80" in screen.text
        assert "21.5 → 30.25" in screen.text
        await screen.press("z")
        assert "outcome" not in screen.text
        await screen.press("z", "tab", "z")
        assert screen.lines[2] == "" or screen.lines[2].startswith(("─", "▸"))
        assert "requests" not in screen.text
        assert "▸ 10.0.0.1 → 10.0.0.5:80" in screen.text

    on_screen(capture(tmp_path, both()), look, size=(80, 30), keys=["8"])


def test_sorted_as_somebody_wants_it(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        for wanted, first in (("address", "visu"), ("rate", "sdo"), ("took", "visu"), ("writes", "visu")):
            screen.app.act("show.sort", wanted)
            await screen.press()
            assert screen.lines[3].split()[1] == first, wanted
        await screen.press("S")
        assert screen.lines[3].split()[1] == "sdo"
        screen.app.act("show.sort", "colour")
        await screen.until(lambda: "Sort by one of: address, rate" in " ".join(screen.text.split()))

    on_screen(capture(tmp_path, both()), look, size=(120, 24), keys=["8"], notes=True)


def test_marks_find_a_pair_again(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        await screen.press("j", "m", "a", "k", "'", "a")
        place: Any = view_of(screen).place()
        assert place.client == "10.0.0.1"

    on_screen(capture(tmp_path, both()), look, keys=["8"])


def test_without_such_traffic_it_says_so_and_what_to_check() -> None:
    async def look(screen: Screen) -> None:
        told = " ".join(" ".join(screen.lines[2:-1]).split())
        assert told.startswith("● No Parameter Manager and no WebVisu was heard")
        for hint in ("nvl` names their port", "ports 80 and 8080", "a mirror port"):
            assert hint in told
        await screen.press("enter", "tab", "j")
        assert "No Parameter Manager" in screen.text

    on_screen(Inquiry([PLANT]), look, keys=["8"])


def test_what_a_controller_says_does_nothing_to_the_terminal(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        await screen.press("enter", "G")
        assert r"\x1b[31m" in screen.text
        assert "\x1b" not in screen.text
        assert "\u202e" not in screen.text
        picture = screen.app.export_screenshot()
        assert not any("\x1b" in text or "\u202e" in text for text in texts_of(picture))
        assert "secret" not in picture

    on_screen(capture(tmp_path, visu_talk(text=ESCAPES)), look, keys=["8"])


@pytest.mark.parametrize("width", [20, 40, 60, 80, 120])
def test_all_views_have_room_from_eighty_columns_on(width: int, tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        assert ("8 Transactions" in screen.lines[1]) == (width >= 80)
        tabs = screen.app.query_one(Tabs)
        for place, view in enumerate(screen.app.views):
            at = screen.lines[1].find(f"{place + 1} {view.title}")
            if at >= 0:
                tabs.clicked(at)
                await screen.press()
                assert screen.app.front is view

    on_screen(capture(tmp_path, both()), look, size=(width, 24), keys=["8"])


def test_looks_share_what_has_not_changed(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        scene = screen.app.scene
        assert scene is not None
        before = scene.transactions.kept
        again = screen.app.feed._watched.look().transactions.kept  # type: ignore[attr-defined]
        assert [one is two for one, two in zip(before, again, strict=True)] == [True, True]

    on_screen(capture(tmp_path, both()), look)
