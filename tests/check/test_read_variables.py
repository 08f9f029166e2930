"""Rules about variables whose values come one by one: those of databases, and of pages."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_source
from nvscope.check.check import Setting
from nvscope.check.read_variables import ReadWatcher
from nvscope.check.variables import FrozenWatch, RangeWatch
from tests.laws import examples
from tests.program_here import run_text
from tests.tracker.datalogger.logs import START_NS, Row, as_changes, write_log
from tests.tracker.datalogger.plain_readings import read

PANEL = str(Path(__file__).parents[2] / "captures" / "visu" / "panel.pcap")


def ruled(folder: Path, source: str, rule: str) -> tuple[str, list[dict[str, Any]]]:
    """Return the verdict on a rule, and its subjects."""
    (folder / "plant.rules.toml").write_text(f'[[rule]]\nid = "one"\n{rule}\n')
    done = run_text("check", source, "--rules", str(folder / "plant.rules.toml"), "--json")
    assert done.stdout, done.stderr
    (told,) = json.loads(done.stdout)["rules"]
    return told["verdict"], told["subjects"]


VARIABLES = [("Plc/nCount", "INT"), ("Plc/fLevel", "DOUBLE"), ("Plc/sMode", "TEXT"), ("Plc/xOn", "TINYINT")]


def logged(folder: Path, *, only_changes: bool) -> str:
    """Write 50 rows, 100 ms apart: a counter, a level that rises, a mode, and what stays on."""
    rows = [Row(100 * number, (number, number / 2, "auto", 1)) for number in range(50)]
    return write_log(folder / "x.db", VARIABLES, rows, only_changes=only_changes)


@pytest.mark.parametrize("only_changes", [False, True])
@pytest.mark.parametrize(
    ("rule", "verdict", "worst", "frames"),
    [
        ('check = "range"\nvariable = "db/x.db/nCount"\nmin = 0\nmax = 60', "pass", 0, []),
        ('check = "range"\nvariable = "db/*/Plc/fLevel"\nmax = 23.9', "fail", 24.5, [49, 50]),
        ('check = "enum"\nvariable = "db/*/sMode"\nvalues = ["auto", "hand"]', "pass", None, []),
        ('check = "enum"\nvariable = "db/*/nCount"\nvalues = [0, 1]', "fail", 2, list(range(3, 13))),
        ('check = "monotonic"\nvariable = "db/*/nCount"', "pass", 0, []),
        ('check = "monotonic"\nvariable = "db/*/nCount"\ndirection = "down"', "fail", 1, list(range(2, 12))),
        ('check = "rate_of_change"\nvariable = "db/*/fLevel"\nmax = 5', "pass", 5, []),
        ('check = "rate_of_change"\nvariable = "db/*/fLevel"\nmax = 4.9', "fail", 5, list(range(2, 12))),
        ('check = "frozen"\nvariable = "db/*/nCount"\nmax = "200ms"', "pass", 0, []),
        ('check = "frozen"\nvariable = "db/*/xOn"\nmax = "200ms"', "fail", 4.9, [4]),
        ('check = "frozen"\nvariable = "db/*/sMode"\nmax = "1min"', "inconclusive", 4.9, []),
    ],
)
def test_a_variable_of_a_database(
    rule: str, verdict: str, worst: float | None, frames: list[int], only_changes: bool, tmp_path: Path
) -> None:
    told, (subject,) = ruled(tmp_path, logged(tmp_path, only_changes=only_changes), rule)
    assert (told, subject["frames"]) == (verdict, frames), subject
    assert subject["worst"] == (None if worst is None else pytest.approx(worst))
    assert (subject["list"], subject["variable"].startswith("db/x.db/Plc/")) == (None, True)


def test_a_variable_of_a_page(tmp_path: Path) -> None:
    told, (subject,) = ruled(tmp_path, PANEL, 'check = "range"\nvariable = "visu/*/PLC_PRG.rActual"\nmax = 21.2')
    assert (told, subject["variable"]) == ("fail", "visu/10.78.0.10/PLC_PRG.rActual")
    assert subject["worst"] == pytest.approx(21.23)
    told, (subject,) = ruled(tmp_path, PANEL, 'check = "monotonic"\nvariable = "visu/10.78.0.10/PLC_PRG.iCount"')
    assert told == "pass"


def test_what_no_rule_can_be_asked_of_is_not_decided(tmp_path: Path) -> None:
    path = logged(tmp_path, only_changes=False)
    told, (subject,) = ruled(tmp_path, path, 'check = "range"\nvariable = "db/*/sMode"\nmin = 0')
    assert (told, "is no number: TEXT" in subject["reason"]) == ("inconclusive", True)
    assert ruled(tmp_path, path, 'check = "range"\nvariable = "db/*/nothing"\nmin = 0')[0] == "inconclusive"


def test_what_is_wrong_with_a_rule_is_told_before_anything_is_read(tmp_path: Path) -> None:
    path = logged(tmp_path, only_changes=False)
    for wrong in ("min = 2\nmax = 1", "", 'min = 0\nwhen = "nv.index == 1"'):
        (tmp_path / "r.toml").write_text(f'[[rule]]\nid = "a"\ncheck = "range"\nvariable = "db/x.db/a"\n{wrong}\n')
        done = run_text("check", path, "--rules", str(tmp_path / "r.toml"))
        assert done.returncode == 2, done.stderr


def test_text_in_a_column_of_numbers_is_no_number(tmp_path: Path) -> None:
    path = write_log(tmp_path / "x.db", [("a", "INT")], [Row(0, (1,)), Row(10, ("broken",)), Row(20, (2,))])
    told, (subject,) = ruled(tmp_path, path, 'check = "range"\nvariable = "db/*/a"\nmin = 0')
    assert (told, subject["frames"]) == ("fail", [2])
    assert "1 value is no number" in subject["reason"]


def test_nothing_is_known_to_last_across_a_loss(tmp_path: Path) -> None:
    rows = [Row(at, (1, at), consistent=0 if at == 500 else 1) for at in range(0, 1000, 100)]
    path = write_log(tmp_path / "x.db", [("xOn", "INT"), ("n", "INT")], rows, only_changes=True)
    _, (subject,) = ruled(tmp_path, path, 'check = "frozen"\nvariable = "db/*/xOn"\nmax = "450ms"')
    assert (subject["count"], subject["worst"]) == (0, pytest.approx(0.4))


_ROWS = st.lists(
    st.builds(
        Row, st.integers(0, 3_000), st.tuples(st.sampled_from([None, 0, 1, 2, 5]), st.integers(0, 3)),
        st.sampled_from([1, 1, 1, 0]),
    ),
    min_size=1, max_size=30,
)  # fmt: skip


Stored = tuple[int, int | None, bool, bool]
"""When a row is, in ms, its value, whether anything may have been missed before it, and whether NULL is a change."""


def stored(rows: Sequence[Row], *, only_changes: bool) -> list[Stored]:
    """Return the first values of rows as they are stored."""
    found: list[Stored] = []
    for row, changed in zip(rows, as_changes([row.values for row in rows]), strict=True):
        assert isinstance(row.at, int)
        value, counters = (changed[0], changed[1::2]) if only_changes else (row.values[0], [None])
        begins_anew = all(one == 0 for one in counters)
        assert value is None or isinstance(value, int)
        to_null = value is None and (changed[1] is not None or not only_changes)
        found.append((row.at, value, row.consistent == 0 or begins_anew, to_null))
    return found


def plain_frozen(rows: Sequence[Stored], most_ms: int, *, lasts: bool) -> tuple[int, int]:
    """Return for how long a value stayed at most, and how often too long, by the rules, row by row."""
    longest = broken = 0
    last: object = None
    since = before = stretch = of = 0
    told = False
    for at, value, parts, to_null in rows:
        stretch += parts
        if to_null:
            last = None
        is_known = lasts and value is None and last is not None and of == stretch
        if value is None and not is_known:
            continue
        if last is None or (value is not None and value != last) or of != stretch or at - before > most_ms:
            since, told = at, False
        last, of = (last if value is None else value), stretch
        before = at
        longest = max(longest, at - since)
        if at - since > most_ms and not told:
            broken, told = broken + 1, True
    return longest, broken


@examples(40)
@given(rows=_ROWS, most_ms=st.integers(1, 900), packets=st.integers(1, 9), only_changes=st.booleans())
def test_verdicts_are_those_of_a_plain_loop_however_rows_are_cut(
    tmp_path_factory: pytest.TempPathFactory, rows: list[Row], most_ms: int, packets: int, only_changes: bool
) -> None:
    path = tmp_path_factory.mktemp("log") / "x.db"
    rows = sorted(rows, key=lambda row: row.at if isinstance(row.at, int) else 0)
    write_log(path, [("a", "INT"), ("b", "INT")], rows, only_changes=only_changes)
    inquiry = Inquiry([str(path)])
    setting = Setting({}, inquiry.fields, None, {})  # type: ignore[arg-type]  # no rows of lists are asked for
    of_range = ReadWatcher(setting, ["db/*/a"], lambda place: RangeWatch(place, least=1, most=2), lasting=False)
    frozen = ReadWatcher(
        setting, ["db/*/a"], lambda place: FrozenWatch(place, most_ns=most_ms * 10**6), lasting=True
    )  # fmt: skip
    for _ in inquiry.run(open_source([str(path)], batch_packets=packets), [of_range, frozen]):
        pass
    variable, _ = read([path])
    out = [reading.frame for reading in variable.readings if not 1 <= reading.value <= 2]
    if not variable.readings:
        assert not of_range.watches
        return
    (one,), (other,) = of_range.watches, frozen.watches
    assert (one.judged, one.broken, one.frames) == (len(variable.readings), len(out), out[:10])
    assert isinstance(other, FrozenWatch)
    longest, broken = plain_frozen(stored(rows, only_changes=only_changes), most_ms, lasts=only_changes)
    assert (other.longest_ns, other.broken) == (longest * 10**6, broken)
    assert one.first_ns is None or one.first_ns >= START_NS
