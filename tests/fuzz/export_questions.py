"""Questions about exports: the same telegrams and values in every form, and those that lines show."""

from __future__ import annotations

import csv
import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from nvscope.errors import ExitCode
from tests.fuzz.asked import READ, Asked
from tests.fuzz.variable_questions import telegrams_of, values_of

_MOST_NS = (1 << 63) - 1
_LONG_TIMES = {"LTIME", "LTOD", "LDATE", "LDT"}
_FORMS = ("ndjson", "csv", "parquet")


def ask_exports(asked: Asked, rows: Sequence[Mapping[str, Any]]) -> None:
    folder = asked.folder / "out"
    folder.mkdir(exist_ok=True)
    telegrams = telegrams_of(rows)
    form = asked.rng.choice(_FORMS)
    wide = asked.on_capture("export", "-w", str(folder / f"wide.{form}"))
    if wide.code in READ:
        written = _tables(folder, form)
        assert sum(map(len, written)) == sum(telegrams.values()), (wide, telegrams)
    _empty(folder)
    long: list[dict[str, Any]] = []
    for form in _FORMS:
        ran = asked.on_capture("export", "--form", "long", "-w", str(folder / f"long.{form}"))
        assert ran.code == wide.code
        if ran.code not in READ:
            assert ran.code == ExitCode.USAGE, ran
            assert not list(folder.iterdir())
            return
        (table,) = _tables(folder, form)
        counted = Counter((row["list"], row["ip.src"], int(row["nv.subindex"])) for row in table)
        assert counted == values_of(rows)
        long = table if form == "ndjson" else long
        _empty(folder)
    asked.answered.values = len(long)
    _compare_with_packets(asked, long)
    asked.on_capture(
        "export", "--what", "telegrams", "-e", "frame.number", "-e", "nv.data", "-w", str(folder / "t.csv")
    )
    _empty(folder)


def _tables(folder: Path, form: str) -> list[list[dict[str, Any]]]:
    """Return the rows of each file of a folder."""
    tables = []
    for path in sorted(folder.iterdir()):
        if form == "parquet":
            import polars as pl  # noqa: PLC0415

            tables.append(pl.read_parquet(path).to_dicts())
        elif form == "csv":
            with path.open(encoding="utf-8", newline="") as file:
                tables.append(list(csv.DictReader(file, strict=True)))
        else:
            # Not splitlines: a text may hold what Python takes for the end of a line.
            tables.append([json.loads(line) for line in path.read_text(encoding="utf-8").split("\n") if line])
    return tables


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()


def _compare_with_packets(asked: Asked, long: Sequence[Mapping[str, Any]]) -> None:
    """The value of a variable in a telegram is the same, whoever tells it."""
    by_variable: dict[tuple[str, str], dict[int, Mapping[str, Any]]] = defaultdict(dict)
    for row in long:
        by_variable[row["list"], row["variable"]][row["frame.number"]] = row
    for key in asked.rng.sample(sorted(by_variable), min(3, len(by_variable))):
        rows = by_variable[key]
        first = next(iter(rows.values()))
        name = f"var.{''.join(c if c.isalnum() or c == '_' else '_' for c in first['list_name'])}.{key[1]}"
        name = name.replace(" ", "")
        ran = asked.on_capture("packets", "-T", "ndjson", "-e", "frame.number", "-e", name)
        if ran.code not in READ:
            continue  # two lists of one name
        told = {}
        for record in ran.records():
            value = record.get(name, record.get(f"{name}_ns"))
            if value is not None:
                told[record["frame.number"]] = value
        for frame, row in rows.items():
            value = next(
                (row[kind] for kind in ("integer", "unsigned", "real", "bytes") if row[kind] is not None), row["text"]
            )
            assert _same(value, told.get(frame), row["type"]), (name, frame, value, told.get(frame), row)
        assert set(told) <= set(rows), name


def _same(exported: Any, shown: Any, kind: str) -> bool:
    """Tell whether two tell one value, each in its own way: NaN as null, times and durations in nanoseconds."""
    if exported == shown or str(exported) == str(shown):
        return True
    if kind in _LONG_TIMES and isinstance(exported, int) and exported > _MOST_NS:
        return shown is None  # a time that an expression cannot compare does not exist for it
    if kind == "REAL" and isinstance(shown, float):
        return bool(np.float32(exported) == np.float32(shown))  # as few digits as tell it from its neighbours
    return isinstance(shown, str) and isinstance(exported, int) and _iso(exported) == shown


def _iso(time_ns: int) -> str:
    seconds, rest_ns = divmod(time_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest_ns:09d}Z"
