"""Databases of DataLoggers that have all that can be wrong with them."""

from __future__ import annotations

from pathlib import Path

from tests.datalogger.audit.built import DECLARED, Row, altered, every_value, later, only_changes, with_cells, write
from tests.records import replace

_BEHIND, _CUT = 60, 30


def make_odd_logs(folder: Path) -> None:
    """Write them into a folder."""
    rows = with_cells(only_changes(60), 9, {}, {"c": 1})
    rows = altered(with_cells(rows, 14, {"c": 1}, {}), 20, consistent=0)
    rows = altered(altered(rows, 30, at_ms=100), 33, stamp="yesterday")
    rows = [*rows, *later(only_changes(5), rows[-1].at_ms + 900), Row(90_000, {"a": 1}, {"a": 2})]
    rows += [Row(90_000 + 250 * n, {"a": n}, {"a": 10 + 2 * n}) for n in range(1, 20)]
    write(folder / "spoiled.db", rows, DECLARED, changes=True)
    values = [replace(row, values={**row.values, "s": "text", "x": b"\1", "i": float("inf")}) for row in every_value()]
    del values[20:25]
    write(folder / "values.db", values, {**DECLARED, "s": "TEXT", "x": "BLOB", "i": "DOUBLE"}, changes=False)
    write(folder / "broken.db.0", every_value(), DECLARED, changes=False)
    many = [replace(row, values={**row.values, "s": "x" * 3_000}) for row in every_value(200)]
    path = write(folder / "broken.db.2", many, {**DECLARED, "s": "TEXT"}, changes=False, page_bytes=1024, form="raw")
    raw = bytearray(path.read_bytes())
    leaf = next(at for at in range(_BEHIND * 1024, len(raw), 1024) if raw[at] == 13)
    raw[leaf : leaf + 4] = bytes(4)
    overflow = next(at for at in range(leaf + 9 * 1024, len(raw), 1024) if raw[at + 4 : at + 1024] == b"x" * 1020)
    raw[overflow : overflow + 4] = b"\xff" * 4
    path.write_bytes(raw)
    path = write(folder / "cut.db", every_value(3_000), DECLARED, changes=False)
    path.write_bytes(path.read_bytes()[: _CUT * 1024])
    (folder / "nothing.db").write_bytes(b"no database")
    write(folder / "empty.db", [], DECLARED, changes=False)
