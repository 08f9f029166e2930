"""The view of packets: what it shows is what ``nvscope packets`` writes, and fields and bytes are linked."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from textual.widgets import ContentSwitcher

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.recent_rows import RecentRows
from nvscope.analysis.watching import Scene, Watching
from nvscope.capture.open import open_source
from nvscope.cli.definitions import project_of
from nvscope.tui.feed import SessionFeed
from nvscope.tui.packets.bytes_pane import BytesPane
from nvscope.tui.packets.fields_pane import FieldsPane
from nvscope.tui.packets.list_pane import PacketList
from nvscope.tui.packets.text import changed_bytes
from nvscope.view.lines.shown import Spans
from tests.program_here import run_text
from tests.tui.screen import Screen, on_screen

CAPTURES = Path(__file__).parents[2] / "captures"
PLANT = str(CAPTURES / "plant.pcapng.gz")
PEERS = str(CAPTURES / "peers" / "peers.pcap")
PRESS = str(CAPTURES / "can" / "press.log")
PEERS_GVL = (str(CAPTURES / "peers"),)
PRESS_GVL = (str(CAPTURES / "can" / "press.gvl"), str(CAPTURES / "can" / "level.gvl"))
WIDE = (160, 50)


def inquiry_of(path: str, definitions: tuple[str, ...] = ()) -> Inquiry:
    return Inquiry([path], project_of(None, list(definitions) or None))


def lines_of_program(path: str, definitions: tuple[str, ...], *options: str) -> list[list[str]]:
    given = [word for one in definitions for word in ("--gvl", one)] if definitions else []
    text = run_text("packets", path, "-q", *(given if options or "can" in path else []), *options).stdout
    return [line.split() for line in text.splitlines()]


async def to_packets(screen: Screen) -> tuple[PacketList, FieldsPane, BytesPane]:
    await screen.press("4")
    panes = (screen.app.query_one(PacketList), screen.app.query_one(FieldsPane), screen.app.query_one(BytesPane))
    await screen.until(lambda: panes[0].frame is not None)
    await screen.until(lambda: "looking" not in screen.text)
    return panes


def rows_of(screen: Screen, shown: PacketList) -> list[list[str]]:
    """Return the lines of the list as words, but for what marks them."""
    region = shown.region
    # Behind the lines is what scrolls them.
    return [line[: region.width - 1].replace("•", " ").split() for line in screen.lines[region.y : region.bottom]]


def underlined(pane: Any) -> str:
    """Return what is underlined in a pane, from top to bottom."""
    return "".join(
        segment.text
        for y in range(pane.size.height)
        for segment in pane.render_line(y)
        if segment.style is not None and segment.style.underline
    )


@pytest.mark.parametrize(
    ("path", "definitions", "expression"),
    [
        (PLANT, (), "nv.index == 9 && nv.counter > 5"), (PLANT, (), "arp"),
        (PLANT, (), 'cause.kind == "second-sender"'), (PRESS, PRESS_GVL, None),
        (PEERS, PEERS_GVL, "var.axis.bStart"),
    ],
)  # fmt: skip
def test_the_list_is_what_the_program_writes(path: str, definitions: tuple[str, ...], expression: str | None) -> None:
    expected = lines_of_program(path, definitions, *(("-Y", expression) if expression else ()))

    async def look(screen: Screen) -> None:
        shown, _, _ = await to_packets(screen)
        await screen.until(lambda: len(shown.numbers) == len(expected))
        assert [row for row in rows_of(screen, shown) if row] == expected[: shown.size.height]
        await screen.press("G")
        assert [row for row in rows_of(screen, shown) if row] == expected[-shown.size.height :]
        assert shown.frame == int(expected[-1][0])

    on_screen(inquiry_of(path, definitions), look, size=WIDE, expression=expression)


def test_a_suspended_filter_marks_what_it_would_choose() -> None:
    every, chosen = lines_of_program(PLANT, ()), lines_of_program(PLANT, (), "-Y", "nv.index == 9")

    async def look(screen: Screen) -> None:
        shown, _, _ = await to_packets(screen)
        screen.app.act("find.filter", "nv.index == 9")
        await screen.until(lambda: len(shown.numbers) == len(chosen))
        await screen.press("backslash")
        await screen.until(lambda: len(shown.numbers) == len(every))
        await screen.press("g")
        region = shown.region
        marked = [line.split()[1] for line in screen.lines[region.y : region.bottom] if line.startswith("•")]
        expected = [row[0] for row in every[: shown.size.height] if row in chosen]
        assert marked
        assert marked == expected
        await screen.press("g", "n", "n")
        assert str(shown.frame) in (chosen[1][0], chosen[2][0])
        await screen.press("N")
        assert str(shown.frame) in (chosen[0][0], chosen[1][0])
        await screen.press("backslash", "g", "n", "n", "N")
        assert str(shown.frame) == chosen[1][0]

    on_screen(Inquiry([PLANT]), look, size=(100, 40))


def test_the_filter_chooses_among_lists_too() -> None:
    async def look(screen: Screen) -> None:
        screen.app.act("find.filter", "nv.index == 9")
        await screen.until(lambda: screen.app.look is not None and screen.app.look.choice is not None)
        await screen.until(lambda: screen.app.look.choice.lists is not None)  # type: ignore[union-attr]
        assert set(screen.app.look.choice.lists) == {"udp/1202/9"}  # type: ignore[union-attr, arg-type]
        assert "192.168.1.11" in screen.text
        assert "192.168.1.12" not in screen.lines[3]

    on_screen(Inquiry([PLANT]), look)


def test_a_variable_lights_its_bytes_and_a_byte_its_variable() -> None:
    async def look(screen: Screen) -> None:
        shown, fields, bytes_pane = await to_packets(screen)
        screen.app.act("find.filter", "nv.index == 42")
        await screen.until(lambda: len(shown.numbers) == 199)
        await screen.press("tab", "j", "j")
        assert "fTemp" in fields.text()
        place = fields.place
        assert place is not None
        assert bytes_pane.lit == place
        assert bytes_pane.text() == bytes_pane.packet[place.start : place.stop].hex(" ")
        await screen.press("tab", "l", "l", "l", "l")
        assert bytes_pane.byte == place.start + 4
        assert "stAxis.pos" in fields.text()
        assert bytes_pane.lit == fields.place
        await screen.press("g")
        assert "Destination" in fields.text()  # its part was folded

    on_screen(inquiry_of(PEERS, PEERS_GVL), look, size=(120, 40))


def test_bytes_that_changed_are_underlined() -> None:
    async def look(screen: Screen) -> None:
        shown, _, bytes_pane = await to_packets(screen)
        screen.app.act("view.packets", "#1205")
        await screen.until(lambda: shown.frame == 1205)
        scene = screen.app.look.scene  # type: ignore[union-attr]
        rows = RecentRows(scene).rows(scene, np.array([1201, 1205]))  # both list 7, SubIndex 1, of one sender
        before, own = (rows.packets.packet(row) for row in range(2))
        others = [f"{one:02x}" for one, other in zip(own, before, strict=True) if one != other]
        assert 0 < len(others) < 20
        assert underlined(bytes_pane) == "".join(others)
        assert f"{len(others)} others than in 1 201" in screen.text

    on_screen(Inquiry([PLANT]), look, size=(120, 40))


def test_messages_are_compared_from_their_beginning_on() -> None:
    own, before = b"\x01\x02\x03" + b"abcd", b"\x01\x02" + b"axc"
    changed = changed_bytes(own, Spans(3, 3, 7), before, Spans(2, 2, 5))
    assert changed.tolist() == [False, False, True, False, True, False, True]


def test_a_frame_that_is_asked_for() -> None:
    async def look(screen: Screen) -> None:
        shown, _, _ = await to_packets(screen)
        screen.app.act("view.packets", "#973")
        await screen.until(lambda: shown.frame == 973)
        screen.app.act("find.filter", "nv.index == 9")
        await screen.until(lambda: len(shown.numbers) < 300)
        screen.app.act("view.packets", "#973")
        await screen.until(lambda: "filter does not" in screen.text)

    on_screen(Inquiry([PLANT]), look, size=(120, 40), notes=True)


def test_the_telegrams_of_one_list() -> None:
    expected = lines_of_program(PLANT, (), "-Y", 'list.key == "udp/1202/12"')

    async def look(screen: Screen) -> None:
        shown, _, _ = await to_packets(screen)
        screen.app.act("view.packets", "udp/1202/12")
        await screen.until(lambda: len(shown.numbers) == len(expected))
        assert [row for row in rows_of(screen, shown) if row] == expected[: shown.size.height]
        await screen.press("q")
        await screen.until(lambda: len(shown.numbers) == 1206)

    on_screen(Inquiry([PLANT]), look, size=WIDE)


def test_the_cursor_goes_to_the_moment_that_is_shown() -> None:
    async def look(screen: Screen) -> None:
        shown, _, _ = await to_packets(screen)
        screen.app.act("time.go", "25s")
        await screen.until(lambda: shown.frame == 967)  # the last one up to 25 s
        assert "past" in screen.text

    rows = lines_of_program(PLANT, ())
    assert max(int(row[0]) for row in rows if float(row[1]) <= 25) == 967
    on_screen(Inquiry([PLANT]), look, size=(120, 40))


def test_marks_and_copies() -> None:
    copied: list[str] = []

    async def look(screen: Screen) -> None:
        shown, fields, _ = await to_packets(screen)
        screen.app.copy_to_clipboard = copied.append  # type: ignore[method-assign, assignment]
        await screen.press("j", "j", "m", "a", "G", "apostrophe", "a")
        assert shown.frame == int(lines_of_program(PLANT, ())[2][0])
        await screen.press("y", "tab", "y")
        assert copied[0].split()[0] == str(shown.frame)
        assert copied[1] == fields.text()
        await screen.press("tab", "y")
        assert bytes.fromhex(copied[2])

    on_screen(Inquiry([PLANT]), look, size=(120, 40))


@pytest.mark.parametrize(("size", "panes"), [((80, 24), 2), ((120, 30), 3), ((20, 10), 1)])
def test_as_many_panes_as_there_is_room_for(size: tuple[int, int], panes: int) -> None:
    async def look(screen: Screen) -> None:
        all_panes = await to_packets(screen)

        def seen() -> int:
            return sum(bool(pane.is_on_screen and pane.region.height) for pane in all_panes)

        await screen.press("j")
        assert seen() == panes
        await screen.press("z")
        assert seen() == 1
        await screen.press("z", "tab")
        assert seen() == panes
        assert "▸ Fields" in screen.text
        if panes == 2:
            await screen.press("x")
            assert "▸ Bytes" in screen.text
            assert seen() == 2
        assert all(len(line) <= size[0] for line in screen.lines)
        assert screen.app.query_one(ContentSwitcher).current == "packets"

    on_screen(Inquiry([PLANT]), look, size=size)


def test_a_filter_is_completed_and_told_what_is_wrong_with_it() -> None:
    async def look(screen: Screen) -> None:
        await to_packets(screen)
        await screen.press("slash", *"nv.indx")
        problem = next(at for at, line in enumerate(screen.lines) if "no field is called nv.indx" in line)
        assert screen.lines[problem + 1].startswith("nv.indx")
        assert screen.lines[problem + 2] == "^^^^^^^"
        await screen.press(*["backspace"] * 7, *"cause.kind", "space", "=", "=", "space", "quotation_mark", *"sec")
        await screen.until(lambda: 'cause.kind == "second-sender"' in screen.text)
        await screen.press("tab", "enter")
        await screen.until(lambda: "10 of 1 206" in screen.text)

    on_screen(Inquiry([PLANT]), look, size=(100, 30))


def test_scenes_of_the_past_keep_no_frames_and_are_told_with_those_that_there_are() -> None:
    feed = SessionFeed(Inquiry(open_source([PLANT])), Watching())
    came, ended = list[Scene](), threading.Event()
    feed.start(came.append, lambda _: ended.set())
    assert ended.wait(30)
    last, span = came[-1], feed.span()
    assert span is not None
    feed.at(span.end_ns, came.append)
    feed.stop()
    assert len(came[-1].recent) == len(last.recent) > 1000
    assert all(not len(kept.recent) for kept in feed._kept._kept)
