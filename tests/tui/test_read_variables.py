"""Variables of databases and of pages on the screen: as ``nvscope vars`` tells them, and their plots."""

from __future__ import annotations

import json
import re
from pathlib import Path

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.player import Player
from nvscope.definition.project import Project
from nvscope.tui.views.variables import VariablesView
from nvscope.view.lines.read_rows import ReadRow
from tests.program_here import run_text
from tests.records import replace
from tests.tracker.datalogger.logs import Row, write_log
from tests.tui.screen import Screen, on_replay, on_screen

CAPTURES = Path(__file__).parents[2] / "captures"
GENUINE = str(CAPTURES / "datalogger" / "genuine-5min.db")
PANEL = str(CAPTURES / "visu" / "panel.pcap")


def row_of(screen: Screen) -> ReadRow:
    view = screen.app.front
    assert isinstance(view, VariablesView)
    assert isinstance(view.row, ReadRow)
    return view.row


async def go_to(screen: Screen, name: str) -> None:
    """Move the cursor to a variable."""
    await screen.press("g")
    for _ in range(200):
        if row_of(screen).name == name:
            return
        await screen.press("j")
    raise AssertionError(screen.text)


def test_the_table_is_what_vars_tells() -> None:
    rows = json.loads(run_text("vars", GENUINE, PANEL, "--json").stdout)
    told = [row for row in [*rows["page_variables"], *rows["logged_variables"]] if row["text"] is not None]

    async def look(screen: Screen) -> None:
        await screen.press("3")
        assert "28 variables of 1 controller and 1 database   100 never readable" in screen.lines[2]
        shown = []
        for _ in told:
            row = row_of(screen)
            shown.append((row.group.listed, row.name, row.type_text, row.text, row.changes, row.bounds))
            await screen.press("j")
        assert shown == [
            (
                row["list"], row["name"], row["type"], row["text"], row["changes"],
                row["min_text"] and (row["min_text"], row["max_text"]),
            )
            for row in told
        ]  # fmt: skip

    on_screen(Inquiry([GENUINE, PANEL], Project()), look, size=(140, 40))


def test_a_plot_of_a_database_and_the_value_at_its_cursor() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await go_to(screen, "Arp.Plc.Eclr/I_2_IN01")
        await screen.press("p")
        await screen.until(lambda: "I_2_IN01  15808  at 14:10:56.424, frame 1 080" in screen.text)
        assert sum("⠀" < sign <= "⣿" for sign in screen.text) > 100
        await screen.press(*["h"] * 20)
        found = re.search(r"I_2_IN01  (\d+)  at (\S+), frame ([\d ]+)", screen.text)
        assert found
        value, time, frame = found.groups()
        done = run_text("vars", GENUINE, "--history", "I_2_IN01", "--utc", environment={"COLUMNS": "200"})
        line = next(line for line in done.stdout.splitlines() if time in line)
        assert f" {value}" in line
        assert frame.strip() in line

    on_screen(Inquiry([GENUINE], Project()), look, size=(100, 36))


def test_a_gap_is_no_line(tmp_path: Path) -> None:
    """Behind a loss that the logger tells, and where rows are missing, nothing is drawn."""
    rows = [Row(1000 * at, (at % 2,)) for at in range(120) if not 30 <= at < 60]
    path = write_log(tmp_path / "x.db", [("Plc/v", "INT")], rows)

    async def look(screen: Screen) -> None:
        await screen.press("3", "p")
        await screen.until(lambda: "Plc/v  1  at " in screen.text)
        drawn = [line for line in screen.lines if "│" in line or "┤" in line]
        middle = {place for line in drawn for place in range(27, 38) if "⠀" < line[place : place + 1] <= "⣿"}
        assert middle == set()
        await screen.press(*["h"] * 50)
        await screen.until(lambda: "nothing came, or it was lost" in screen.text)

    on_screen(Inquiry([path], Project()), look, size=(80, 24))


def test_a_value_of_which_only_changes_are_stored_stays_until_the_next_one(tmp_path: Path) -> None:
    # It changes twice within a minute; another one changes all the time, and data is lost behind the second half.
    rows = [Row(1000 * at, (0 if at < 20 else 5, at), 0 if at == 45 else 1) for at in range(60)]
    path = write_log(tmp_path / "x.db", [("Plc/v", "INT"), ("Plc/z", "INT")], rows, only_changes=True)

    async def look(screen: Screen) -> None:
        await screen.press("3")
        await go_to(screen, "Plc/v")
        await screen.press("p")
        await screen.until(lambda: "Plc/v  5  at 08:00:44" in screen.text)
        drawn = [line for line in screen.lines if "│" in line or "┤" in line]
        assert [line[64:] for line in drawn] == [""] * len(drawn), "it was not stored behind the loss"
        await screen.press(*["h"] * 40)
        assert re.search(r"Plc/v  5  at 08:00:\d\d\.000, frame", screen.text), "known in rows that do not store it"

    on_screen(Inquiry([path], Project()), look, size=(80, 24))


def test_passwords_are_hidden_and_have_no_plot() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await go_to(screen, ".CurrentPassword")
        await screen.press("p")
        await screen.until(lambda: "it has no plot" in screen.text)
        await screen.press("enter")
        assert "(hidden)" in screen.text
        assert "geheim" not in screen.text
        view = screen.app.front
        assert isinstance(view, VariablesView)
        assert view.copied() == ".CurrentPassword = (hidden)"

    assert "geheim" in run_text("vars", PANEL, "--show-secrets").stdout
    on_screen(Inquiry([PANEL], Project()), look, size=(120, 40))


def test_the_details_of_a_variable_of_a_page() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await go_to(screen, "PLC_PRG.iCount")
        await screen.press("enter")
        told = " ".join(screen.text.split())
        assert "Controller visu/10.78.0.10" in told
        row = row_of(screen)
        assert f"Place {row.place} Read {row.readings} times; the last at" in told
        await screen.press("enter")
        front = screen.app.front
        assert front is not None
        assert front.action == "view.packets"

    on_screen(Inquiry([PANEL], Project()), look, size=(120, 40))


def test_a_filter_leaves_the_databases_and_pages_whose_frames_it_chooses() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        screen.app.act("find.filter", "db.values > 0")
        await screen.until(lambda: "18 variables" in screen.lines[2])
        assert "visu/" not in "\n".join(screen.lines[2:])
        screen.app.act("find.filter", 'visu.variable == "PLC_PRG.iCount"')
        await screen.until(lambda: "10 variables" in screen.lines[2])
        assert "genuine" not in "\n".join(screen.lines[2:])
        await screen.press("\\")
        await screen.until(lambda: "28 variables" in screen.lines[2])

    on_screen(Inquiry([GENUINE, PANEL], Project()), look, size=(140, 40))


def test_marks_sorting_and_one_database_alone() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await go_to(screen, "Arp.Plc.Eclr/I_2_IN01")
        await screen.press("m", "a", "g")
        assert row_of(screen).group.listed == "visu/10.78.0.10"
        screen.app.act("view.variables", "db/genuine-5min.db")
        assert "only db/genuine-5min.db 18 variables" in screen.lines[2]
        screen.app.act("show.sort", "changes")
        assert row_of(screen).name.startswith("Arp.Plc.Eclr/")
        await screen.press("'", "a")
        assert row_of(screen).name == "Arp.Plc.Eclr/I_2_IN01"
        await screen.press("#")
        assert "notched" in screen.lines[2]

    on_screen(Inquiry([GENUINE, PANEL], Project()), look, size=(140, 40))


def test_at_a_moment_of_the_past_the_values_were_others() -> None:
    async def look(screen: Screen) -> None:
        await screen.press("3")
        await go_to(screen, "Arp.Plc.Eclr/I_2_IN01")
        screen.app.act("time.go", "10s")
        await screen.until(lambda: row_of(screen).changes < 100)
        rows = json.loads(run_text("vars", GENUINE, "--at", "10s", "--json").stdout)["logged_variables"]
        then = next(row for row in rows if row["name"] == row_of(screen).name)
        assert (row_of(screen).text, row_of(screen).last_ns) == (then["text"], int(then["sent_ns"]))

    on_screen(Inquiry([GENUINE], Project()), look, size=(140, 40))


def test_a_database_is_played() -> None:
    player = Player()
    player.pause(True)

    async def look(screen: Screen) -> None:
        await screen.press("3")
        screen.app.act("time.go", "60s")
        await screen.until(lambda: "18 variables" in screen.lines[2])
        await go_to(screen, "Arp.Plc.Eclr/I_2_IN01")
        await screen.until(lambda: 100 < row_of(screen).changes < 500)
        there = row_of(screen).last_frame
        await screen.press(".")
        await screen.until(lambda: row_of(screen).last_frame == there + 1)
        await screen.press(",")
        await screen.until(lambda: row_of(screen).last_frame == there)

    on_replay(Inquiry([GENUINE], Project()), player, look)


def test_that_variables_are_left_out_is_told() -> None:
    project = replace(Project(), limits=replace(Project().limits, max_streams=5))

    async def look(screen: Screen) -> None:
        await screen.press("3")
        assert " 5 variables   of databases, those beyond the first 5 are left out" in screen.lines[2]

    on_screen(Inquiry([GENUINE], project), look, size=(140, 40))
