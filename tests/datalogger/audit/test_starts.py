"""A logger that starts anew beside a real number that is none, which SQLite keeps as NULL: nothing is wrong with it."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.capture.datalogger import table_rows
from nvscope.datalogger.audit.audit import audited
from tests.datalogger.audit.built import Row, write
from tests.datalogger.audit.oracle import expected
from tests.datalogger.audit.test_oracle import by_kind

DECLARED = {"a": "SMALLINT", "b": "FLOAT", "c": "DOUBLE"}
AT_ONCE = (16_000, 3, 2, 1)
ZERO = dict.fromkeys("abc", 0)


def start(at_ms: float, a: int | None, b: float | None, c: float | None) -> Row:
    return Row(at_ms, {"a": a, "b": b, "c": c}, ZERO)


GOOD = {
    "one start behind the other": [
        start(0, 1, 1.5, 2.5), Row(250, {"a": 2}, {"a": 1}), start(500, 3, 1.5, 2.5), start(750, 3, None, 2.5),
        Row(1_000, {"a": 4}, {"a": 1}), Row(1_250, {"b": 1.5}, {"b": 1}),
    ],
    "of what had not changed since": [
        start(0, 1, 1.5, 2.5), Row(250, {"a": 2}, {"a": 1}), start(500, 3, None, None),
        Row(750, {"a": 4, "c": 2.5}, {"a": 1, "c": 1}), Row(1_000, {"b": 1.5}, {"b": 1}),
    ],
    "twice": [
        start(0, 1, None, 2.5), start(250, 1, None, 2.5), Row(500, {"a": 2, "b": 1.5}, {"a": 1, "b": 1}),
        start(750, 1, None, 2.5), start(1_000, 1, None, None), Row(1_250, {"a": 2}, {"a": 1}),
    ],
}  # fmt: skip


@pytest.mark.parametrize("rows", GOOD.values(), ids=GOOD)
def test_a_start_beside_a_number_that_is_none_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: list[Row]
) -> None:
    path = write(tmp_path / "x.db", rows, DECLARED, changes=True)
    starts = [number for number, row in enumerate(rows[1:], 2) if row.counts == ZERO]
    assert expected(path, "log_changes_1", changes=True) == {("NV954", "note", None): starts}
    for at_a_time in AT_ONCE:
        monkeypatch.setattr(table_rows, "_ROWS", at_a_time)
        assert by_kind(audited([str(path)])) == {("NV954", "note", None): starts}, at_a_time


def test_a_counter_that_is_repeated_in_the_style_of_the_document_starts_nothing(tmp_path: Path) -> None:
    """The counter of the value beside those is wrong; of one that is no number, nothing would say that."""
    rows = [
        Row(0, {"a": 1, "b": 1.5, "c": 2}, ZERO), Row(250, {"b": 1.75}, ZERO),
        Row(500, {"a": 2, "b": 2.5}, {"a": 1, "b": 2, "c": 0}),
    ]  # fmt: skip
    path = write(tmp_path / "x.db", rows, {"a": "SMALLINT", "b": "FLOAT", "c": "SMALLINT"}, changes=True)
    found = by_kind(audited([str(path)]))
    assert found == expected(path, "log_changes_1", changes=True)
    assert found["NV954", "error", "b"] == [2]
