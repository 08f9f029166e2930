"""The variables on the screen, of real captures: the same as ``nvscope vars`` tells, and what keys do with them."""

from __future__ import annotations

import re
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project_file import read_project
from nvscope.tui.views.variables import VariablesView
from nvscope.view.lines.variable_rows import VariableRow
from tests.fuzz.definition_floods import gvl
from tests.program_here import run_text
from tests.tui.screen import Screen, on_screen

CAPTURES = Path(__file__).parents[2] / "captures"
PEERS = CAPTURES / "peers" / "peers.pcap"
AXIS = [str(CAPTURES / "peers" / name) for name in ("axis.gvl", "axis_types.st", "batch.gvl", "recipe.gvl")]
PRESS = [str(CAPTURES / "can" / name) for name in ("press.gvl", "level.gvl")]


def inquiry_into(capture: Path, definitions: list[str]) -> Inquiry:
    return Inquiry([str(capture)], read_project(None, definitions))


def view_of(screen: Screen) -> VariablesView:
    view = screen.app.front
    assert isinstance(view, VariablesView)
    return view


def row_of(screen: Screen) -> VariableRow:
    row = view_of(screen).row
    assert isinstance(row, VariableRow)
    return row


def test_the_table_is_what_vars_tells() -> None:
    named = [word for name in AXIS for word in ("--gvl", name)]
    told = run_text("vars", str(PEERS), *named, "--utc", environment={"COLUMNS": "200"}).stdout.splitlines()
    begin = next(number for number, line in enumerate(told) if line.startswith("udp/1202/42"))
    columns = [re.split(r"  +", line.strip()) for line in told[begin + 2 :]]

    async def look(screen: Screen) -> None:
        await screen.press("3", "G")
        await screen.until(lambda: "sText" in screen.text)
        # Without the bar at the right, and without list and sender.
        lines = [line.rstrip(" ▁▂▃▄▅▆▇█") for line in screen.lines if "42 axis" in line]
        shown = [re.split(r"  +", line.partition("10.77.0.3")[2].strip()) for line in lines]
        assert len(shown) > 8
        # All but when it changed: here it is how long ago that was.
        cells = [[*row[:3], *row[4:]] for row in shown]
        assert cells == [[*row[:3], *row[4:]] for row in columns[-len(cells) :]]

    on_screen(inquiry_into(PEERS, AXIS), look, size=(120, 40))


def test_a_notch_and_back() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await screen.until(lambda: "◆" in "".join(screen.lines[4:]))
        await screen.press("#")
        assert re.search(r"# \d+ notched", screen.lines[2])
        assert "◆" not in "".join(screen.lines[4:])
        await screen.press("#")
        assert "notched" not in screen.text
        assert "◆" in "".join(screen.lines[4:])

    on_screen(inquiry_into(PEERS, AXIS), look)


def test_the_variables_of_one_list() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await screen.until(lambda: "1 batch" in screen.text)
        screen.app.act("view.variables", "udp/1202/42")
        await screen.until(lambda: "only 42 axis" in screen.lines[2])
        assert "1 batch" not in screen.text
        assert "bStart" in screen.text
        await screen.press("q")
        assert "only" not in screen.lines[2]
        assert "of 3 lists" in screen.lines[2]
        screen.app.act("view.variables", "udp/1202/9")
        await screen.until(lambda: "No value of this list" in screen.text)

    on_screen(inquiry_into(PEERS, AXIS), look)


def test_a_plot_and_the_values_at_its_cursor() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3", "j")
        await screen.until(lambda: "speed" in screen.text)
        row = row_of(screen)
        assert row.element.name == "speed"
        await screen.press("p")
        await screen.until(lambda: f"speed  {row.text}  at " in screen.text)
        assert sum("⠀" < sign <= "⣿" for sign in screen.text) > 100
        await screen.press(*["h"] * 30)
        found = re.search(r"speed  (-?\d+)  at (\S+), frame (\d+)", screen.text)
        assert found
        value, time, frame = found.groups()
        done = run_text("vars", str(PEERS), "--gvl", AXIS[2], "--history", "speed", "--all", "--utc")
        told = next(line.split() for line in done.stdout.splitlines() if line.startswith(time))
        assert (told[1], told[-1]) == (frame, value)
        await screen.press("q")
        assert f"speed  {row.text}  at " in screen.text, "the cursor is gone, the plot is there"
        await screen.press("z")
        assert "42 axis" not in screen.text
        await screen.press("q")
        assert "◆  1 batch" in screen.text

    on_screen(inquiry_into(PEERS, AXIS), look, size=(80, 30))


def test_what_has_no_numbers_has_no_plot() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3", "j", "j", "j", "j", "p")
        await screen.until(lambda: "STRING(20): only numbers" in screen.text)

    on_screen(inquiry_into(PEERS, AXIS), look)


def test_the_details_of_a_variable_of_can() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3", "j", "j", "enter")
        await screen.until(lambda: "Came" in screen.text)
        row = row_of(screen)
        told = " ".join(screen.text.split())
        assert "can/can0/0x110 press, packed as assumed" in told
        assert f"Place frame {row.group.key.subindex}, byte {row.offset_bytes}: {row.raw.hex(' ')}" in told
        assert f"Changed {row.changes} times" in told
        assert "Between 0 and 199" in told
        assert "CAN lists: packed as assumed" in screen.lines[2]

    on_screen(inquiry_into(CAPTURES / "can" / "press.log", PRESS), look)


def test_at_a_moment_of_the_past_the_values_were_others() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3", "j", "p")
        await screen.until(lambda: "frame" in screen.text)
        now, last_ns = row_of(screen), screen.app.look
        assert last_ns is not None
        screen.app.act("time.go", "3s")
        await screen.until(lambda: row_of(screen).changes < now.changes)
        row = row_of(screen)
        done = run_text("vars", str(PEERS), "--gvl", AXIS[2], "--at", "3s", "--json")
        assert f'"text": "{row.text}"' in done.stdout
        await screen.until(lambda: f"speed  {row.text}  at " in screen.text)
        await screen.press("F")
        await screen.until(lambda: f"speed  {now.text}  at " in screen.text)

    on_screen(inquiry_into(PEERS, AXIS), look, size=(80, 30))


def test_without_definitions_it_says_what_to_do() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await screen.until(lambda: "No list is defined" in screen.text)
        assert "--gvl FILE" in screen.text
        assert "vars FILE --infer" in " ".join(screen.text.split())
        assert "udp/1202/42" in screen.text

    on_screen(inquiry_into(PEERS, []), look)


def test_a_stream_that_is_silent_does_not_look_alive(tmp_path: Path) -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await screen.until(lambda: "silent 6 s" in screen.text)
        line = next(line for line in screen.lines if "silent 6 s" in line)
        assert not re.search("[◆◇]", line)

    (tmp_path / "conveyor.gvl").write_text(gvl("v : ARRAY[0..3] OF UDINT;", 12))
    plant = CAPTURES / "plant.pcapng.gz"
    on_screen(inquiry_into(plant, [str(tmp_path / "conveyor.gvl")]), look, size=(120, 24))
