"""A table that was gone on with by other tasks: which variables are of one task is found for each part of it."""

from __future__ import annotations

from collections import Counter
from itertools import permutations
from pathlib import Path

import pytest

from nvscope.capture.datalogger import table_rows
from nvscope.datalogger.audit.audit import Audit, audited
from nvscope.datalogger.audit.time_strip import Mark
from tests.datalogger.audit.built import Row, later, write
from tests.datalogger.audit.test_planted import told
from tests.datalogger.audit.test_tasks import MS, tasks
from tests.datalogger.plants import configuration, gvl, rows_of, simulated
from tests.laws import crossed
from tests.program_here import run_text
from tests.records import replace

PAUSE_MS = 60_000
LOST = ("NV951", "note", None)
KINDS = {
    "apart": [replace(row, at_ms=row.at_ms + 2 * ("b" in row.values)) for row in tasks({"a": 200, "b": 200}, 5_000)],
    "slow": tasks({"a": 50, "b": 200}, 5_000),
    "together": [Row(100 * at, {"a": at, "b": at}) for at in range(150)],
    "longer": [Row(100 * at, {"a": at, "b": at}) for at in range(400)],
    "one": [Row(100 * at, {"a": at}) for at in range(150)],
}
TASKS = {"apart": 2, "slow": 2, "together": 1, "longer": 1, "one": 1}


def parts_of(*kinds: str) -> tuple[list[Row], list[int]]:
    """Return rows of parts, each task of which says first that data was lost, and the places of their first ones."""
    rows: list[Row] = []
    begins = []
    for number, kind in enumerate(kinds):
        begins.append(len(rows))
        own = later(KINDS[kind], number * PAUSE_MS)
        firsts = range(TASKS[kind] if number else 0)
        rows += [replace(row, consistent=0) if at in firsts else row for at, row in enumerate(own)]
    return rows, begins


def audit_of(folder: Path, rows: list[Row], asked_ms: int | None = None) -> Audit:
    path = write(folder / "x.db", rows, {"a": "INT", "b": "INT"}, changes=False)
    return audited([str(path)], None if asked_ms is None else asked_ms * MS)


@pytest.mark.parametrize("at_a_time", [16_000, 7])
@pytest.mark.parametrize(
    "kinds", [*permutations(["apart", "together", "longer"]), ("slow", "together", "apart"), ("one", "apart", "one"),
              ("longer", "apart"), ("apart", "together", "slow", "longer")],
)  # fmt: skip
def test_parts_of_other_tasks_lack_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kinds: tuple[str, ...], at_a_time: int
) -> None:
    rows, begins = parts_of(*kinds)
    monkeypatch.setattr(table_rows, "_ROWS", at_a_time)
    audit = audit_of(tmp_path, rows)
    assert {one[0] for one in told(audit)} == {"NV951"}
    (table,) = audit.tables
    assert table.audit.task_count == 2
    # A variable is known in all rows of its own task; and no time is missing but that between two parts.
    assert [(one.unknown, one.stored) for one in table.audit.figures] == [
        (0, sum(name in row.values for row in rows)) for name in "ab"
    ]
    between = sum(rows[at].at_ms - rows[at - 1].at_ms for at in begins[1:])
    missing_ms = table.audit.coverage.missing_ns / MS
    assert between - 500 * len(begins) <= missing_ms <= between + 200 * len(begins)


@pytest.mark.parametrize(
    ("part", "kinds", "how"),
    crossed(
        [0, 1, 2], [*permutations(["apart", "together", "longer"]), ("longer", "slow", "together")],
        [(16_000, None), (7, 100), (16_000, 100), (7, None)],
    ),
)  # fmt: skip
def test_a_row_that_lacks_in_any_part_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kinds: tuple[str, ...], part: int, how: tuple[int, int | None]
) -> None:
    at_a_time, asked_ms = how
    rows, begins = parts_of(*kinds)
    monkeypatch.setattr(table_rows, "_ROWS", at_a_time)
    place = begins[part] + 20
    gone = rows.pop(place)
    behind = next(at for at, row in enumerate(rows[place:], place + 1) if row.values.keys() & gone.values.keys())
    found = [one for one in told(audit_of(tmp_path, rows, asked_ms)) if one[0] == "NV952"]
    assert found == [("NV952", "error", None, (behind,))]


def test_what_is_lost_between_parts_of_other_tasks_is_told_once(tmp_path: Path) -> None:
    rows, _ = parts_of("longer", "together", "longer", "together")
    one = audit_of(tmp_path, rows).tables[0].audit.coverage
    rows, _ = parts_of("longer", "apart", "longer", "apart")
    other = audit_of(tmp_path, rows).tables[0].audit.coverage
    assert +one.gaps == Counter({Mark.TOLD: 3})
    # Each task has a gap of its own, at one time.
    assert +other.gaps == Counter({Mark.TOLD: 5})
    assert one.missing_ns == (2 * 20_100 + 45_100 - 3 * 100) * MS


def test_clocks_that_were_set_between_parts_of_other_tasks_are_told(tmp_path: Path) -> None:
    first, _ = parts_of("longer")
    behind = [replace(row, consistent=int(at > 1)) for at, row in enumerate(later(KINDS["apart"], -PAUSE_MS))]
    found = told(audit_of(tmp_path, [*first, *behind]))
    assert found == [(*LOST, (401, 402)), ("NV955", "warning", None, (401, 402))]


@pytest.mark.parametrize("order", ["TII", "ITI", "IIT"])
def test_a_database_that_is_gone_on_with_by_other_tasks_has_no_gaps(tmp_path: Path, order: str) -> None:
    lists = [
        f'[[list]]\nname = "list{n}"\nindex = {n}\nsender = "press"\nbytes = [4]\ninterval = "200ms"\n'
        f'phase = "{3 * n}ms"\n' for n in (1, 2)
    ]  # fmt: skip
    for number, name in enumerate(("dwFirst", "dwSecond"), 1):
        (tmp_path / f"list{number}.gvl").write_text(gvl(number, [name], interval="200ms"), encoding="utf-8")
    general = 'samplingInterval="100ms" publishInterval="1s" bufferCapacity="100"'
    text = configuration(["a/T1/dwFirst", "a/T2/dwSecond"], general)
    (tmp_path / "c.xml").write_text(text, encoding="utf-8")
    for minute, kind in enumerate(order):
        project = '[datalogger.tasks]\nT1 = "list1"\nT2 = "list2"\n' if kind == "T" else ""
        (tmp_path / "nvscope.toml").write_text(project, encoding="utf-8")
        head = f'title = "x"\nduration = "{5 if kind == "T" else 15}s"\nseed = 3\n'
        start = f"start = 2024-01-01T00:0{minute}:00+00:00\n"
        node = '[[node]]\nname = "press"\naddress = "192.168.1.10"\n'
        simulated(tmp_path, "".join([head, start, node, *lists]))
        done = run_text("datalog", "plant.pcap", "--config", "c.xml", "--gvl", ".", "--append", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert sum(row[3] is None or row[4] is None for row in rows_of(tmp_path / "log.db")) >= 48
    audit = audited([str(tmp_path / "log.db")])
    assert {one[0] for one in told(audit)} == {"NV951"}
