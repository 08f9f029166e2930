"""Audits on any screen, of variables of any name: no error, and no line wider than the screen."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from nvscope.datalogger.audit.audit import audited
from nvscope.datalogger.audit.lines import lines
from nvscope.view.lines.text_width import display_width
from tests.datalogger.audit.built import Row, without, write
from tests.laws import examples
from tests.program_here import run_text

LONG = "Arp.Plc.Eclr/Main." + "x" * 60
LEAST = 9
"""Columns that three columns of one character take, with what is between them and in front."""

NAMES = st.sampled_from(
    ["", " ", "   ", "\t", "\x1b[31m", "\u200b", "\u0301", "値" * 30, "a", LONG, LONG + "2"]
) | st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=50)


def database(folder: Path, names: list[str], *, changes: bool) -> Path:
    declared = {name: "DOUBLE" if place else "TEXT" for place, name in enumerate(names)}
    rows = [
        Row(n * 250, {name: n * 1.25e9 if place else names[n % len(names)] for place, name in enumerate(names)},
            dict.fromkeys(names, n))
        for n in range(30)
    ]  # fmt: skip
    return write(folder / "x.db", without(rows, 20), declared, changes=changes)


def is_column(name: str) -> bool:
    """Tell whether SQLite takes a name for a column beside those that each table has."""
    return name.casefold() not in {"timestamp", "consistentdataseries"} and not name.endswith("_change_count")


@examples(60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    names=st.lists(NAMES.filter(is_column), min_size=1, max_size=5, unique_by=str.casefold), changes=st.booleans(),
    widths=st.lists(st.integers(1, 60), min_size=1, max_size=6),
)  # fmt: skip
def test_any_names_fit_any_screen(tmp_path: Path, names: list[str], changes: bool, widths: list[int]) -> None:
    audit = audited([str(database(tmp_path, names, changes=changes))])
    assert len(audit.tables[0].audit.names) == len(names)
    for width in widths:
        told = ["".join(cell.text for cell in line) for line in lines(audit, width)]
        assert told
        if width >= LEAST:
            assert [line for line in told if display_width(line) > width] == []


@pytest.mark.parametrize("columns", [1, 2, 5, 12, 40])
@pytest.mark.parametrize("verb", [["audit"], ["audit", "--all"], ["vars"], ["vars", "--history", "*"], ["report"]])
def test_a_name_that_is_empty_ends_no_verb(tmp_path: Path, verb: list[str], columns: int) -> None:
    path = database(tmp_path, ["", LONG], changes=False)
    done = run_text(verb[0], path, *verb[1:], environment={"COLUMNS": str(columns)})
    assert done.returncode in (0, 1), done.stderr
    assert done.stdout
