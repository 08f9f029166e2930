"""Rows of variables: what the screen shows is what ``nvscope vars`` tells of the same capture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.watching import Scene, scene_at
from nvscope.definition.project_file import read_project
from nvscope.definition.variables import type_text
from nvscope.view.lines.variable_cells import Freshness, Notch, cells, cut, freshness
from nvscope.view.lines.variable_rows import Order, VariableRow, VariableRows
from tests.program_here import run_text

CAPTURES = Path(__file__).parents[3] / "captures"
S_NS = 1_000_000_000

PEERS = "peers/peers.pcap", [
    "peers/axis.gvl", "peers/axis_types.st", "peers/batch.gvl", "peers/counters.gvl", "peers/recipe.gvl",
]  # fmt: skip
CAN = "can/press.log", ["can/press.gvl", "can/level.gvl"]


def scene_of(capture: str, definitions: list[str]) -> Scene:
    paths = [str(CAPTURES / name) for name in definitions]
    scene = scene_at(Inquiry([str(CAPTURES / capture)], read_project(None, paths)), None)
    assert scene is not None
    return scene


def rows_in(rows: VariableRows) -> list[VariableRow]:
    found = [rows.row(number) for number in range(len(rows))]
    return [row for row in found if isinstance(row, VariableRow)]


def told_by_vars(capture: str, definitions: list[str]) -> list[dict[str, Any]]:
    named = [word for name in definitions for word in ("--gvl", str(CAPTURES / name))]
    done = run_text("vars", str(CAPTURES / capture), *named, "--json")
    assert done.returncode == 0, done.stderr
    rows: list[dict[str, Any]] = json.loads(done.stdout)["variables"]
    return rows


@pytest.mark.parametrize(("capture", "definitions"), [PEERS, CAN], ids=["peers", "can"])
def test_all_that_vars_tells_is_shown(capture: str, definitions: list[str]) -> None:
    rows = rows_in(VariableRows(scene_of(capture, definitions).variables))
    told = told_by_vars(capture, definitions)
    assert len(rows) == len(told) > 5
    for row, entry in zip(rows, told, strict=True):
        key = row.group.key
        assert (str(key.list), key.subindex, key.sender) == (entry["list"], entry["subindex"], entry["sender"])
        assert (row.element.name, type_text(row.element.type)) == (entry["name"], entry["type"])
        assert (row.text, row.bounds) == (entry["text"], entry["min_text"] and (entry["min_text"], entry["max_text"]))
        assert (row.changes, row.changed_ns) == (entry["changes"], int(entry["changed_ns"]))
        assert (row.known.telegrams, row.known.last_ns) == (entry["telegrams"], int(entry["last_ns"]))


def test_rows_are_found_again_in_any_order() -> None:
    streams = scene_of(*PEERS).variables
    plain = {row.key for row in rows_in(VariableRows(streams))}
    before = None
    for order in Order:
        for backwards in (False, True):
            rows = VariableRows(streams, order=order, backwards=backwards, before=before)
            assert {row.key for row in rows_in(rows)} == plain
            assert [rows.find(row.key) for row in rows_in(rows)] == list(range(len(rows)))
            before = rows
    by_name = [row.element.name for row in rows_in(VariableRows(streams, order=Order.NAME))]
    assert by_name.index("temps[9]") < by_name.index("temps[10]")
    changes = [row.changes for row in rows_in(VariableRows(streams, order=Order.CHANGES))]
    assert changes == sorted(changes, reverse=True)
    changed = [row.changed_ns for row in rows_in(VariableRows(streams, order=Order.CHANGED)) if row.changes]
    assert changed == sorted(changed, reverse=True)


def test_rows_of_some_lists_only() -> None:
    streams = scene_of(*PEERS).variables
    rows = VariableRows(streams, {"udp/1202/42"})
    assert {str(row.group.key.list) for row in rows_in(rows)} == {"udp/1202/42"}
    assert rows.find(VariableRows(streams).row(0).key) is None
    assert not len(VariableRows(streams, set()))
    assert not len(VariableRows((), order=Order.NAME))


def test_a_change_stands_out_and_fades() -> None:
    rows = rows_in(VariableRows(scene_of(*PEERS).variables))
    speed = next(row for row in rows if row.element.name == "nSpeed")
    never = next(row for row in rows if not row.changes)
    ages = [0, S_NS - 1, S_NS, 3 * S_NS - 1, 3 * S_NS]
    just, lately, calm = Freshness.JUST, Freshness.LATELY, Freshness.CALM
    assert [freshness(speed, speed.changed_ns + age) for age in ages] == [just, just, lately, lately, calm]
    assert freshness(never, never.changed_ns) is calm

    def shown(row: VariableRow, age_ns: int, **how: Any) -> list[str]:
        how = {"list_name": "42", "sender": "", "notched": False, **how}
        return [cell.text for cell in cells(row, row.changed_ns + age_ns, **how)]

    assert [shown(speed, age)[0] for age in (0, S_NS, 3 * S_NS)] == ["◆", "◇", ""]
    assert shown(speed, 0, notched=True)[0] == ""
    assert (shown(speed, 0, grown_old="silent 6 s")[0], shown(speed, 0, grown_old="silent 6 s")[-1]) == (
        "", "silent 6 s",
    )  # fmt: skip


def test_a_notch_leaves_out_what_changes_when_it_is_cut() -> None:
    rows = VariableRows(scene_of(*PEERS).variables)
    changed_ns = max(row.changed_ns for row in rows_in(rows))
    notch = Notch()
    notch.cut(rows.groups, changed_ns)
    for row in rows_in(rows):
        assert (row.key in notch) == (row.changes > 0 and changed_ns - row.changed_ns < 3 * S_NS)
    assert notch.count == sum(row.key in notch for row in rows_in(rows)) > 0
    notch.clear()
    assert (notch.count, rows.row(0).key in notch) == (0, False)


def test_long_values_are_cut_at_their_end() -> None:
    assert cut("'abc'", 10) == "'abc'"
    assert cut("'abcdefghijkl'", 10) == "'abcdefgh…"
    assert cut("'abcdefgh\\x00'", 11) == "'abcdefgh…"
