"""Values on CAN: every way to ask for them tells what a packer of its own says that each frame holds."""

from __future__ import annotations

import csv
import math
import tempfile
import warnings
from collections import defaultdict
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from hypothesis import example, given
from hypothesis import strategies as st

import nvscope
from nvscope.view.escape import visible
from tests.can_plant import DATES, LONG_TIMES, MOST_NS, CanPlant, Element, Sent, drawn_plant
from tests.fuzz.program import run
from tests.laws import examples

SEEDS = st.integers(0, 100_000)


def type_of(one: Sent, name: str) -> Element:
    assert one.list
    return next(element for element in one.list.elements if element.name == name)


def key_of(one: Sent) -> str:
    assert one.list
    return f"can/{one.channel}/{one.list.cob_id}"


def same(told: Any, expected: Any) -> bool:
    if isinstance(expected, float):
        return isinstance(told, float) and (told == expected or (math.isnan(told) and math.isnan(expected)))
    return type(told) is type(expected) and bool(told == expected)


def in_its_unit(one: Sent, name: str) -> Any:
    """Return a value as JSON has it: durations in ns, dates in the unit of their type, what is no number as null."""
    value, kind = one.values[name], type_of(one, name).type
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value // 10**9 if kind in ("DATE", "DT") else value


def beyond(one: Sent, name: str) -> bool:
    return type_of(one, name).type in LONG_TIMES and one.values[name] > MOST_NS


def iso(time_ns: int) -> str:
    seconds, rest_ns = divmod(time_ns, 10**9)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest_ns:09d}Z"


def expected_long(plant: CanPlant) -> list[tuple[int, str, str, str, Any]]:
    return [
        (one.frame, key_of(one), one.list.name, name, value)
        for one in plant.told()
        if one.list
        for name, value in one.values.items()
    ]


def long_value(row: dict[str, Any]) -> Any:
    (value,) = [row[kind] for kind in ("integer", "unsigned", "real", "text", "bytes") if row[kind] is not None]
    return bool(value) if row["type"] == "BOOL" else value


@examples(25)
@given(seed=SEEDS)
@example(seed=94724)  # a text with a backslash
def test_the_long_form_has_every_value(seed: int) -> None:
    plant = drawn_plant(seed)
    with tempfile.TemporaryDirectory() as folder:
        log, options = plant.write(Path(folder))
        path = f"{folder}/out.parquet"
        assert run("export", log, *options, "--form", "long", "-w", path, "-q").code == 0
        table = pl.read_parquet(path)
        with warnings.catch_warnings(action="ignore"):
            files = [option for option in options if option != "--gvl"]
            frame = nvscope.open(log, definitions=files).values(form="long")
        assert frame.cast({pl.Categorical: pl.String}).equals(table.cast({pl.Categorical: pl.String}))
        assert run("export", log, *options, "--form", "long", "-w", f"{folder}/out.csv", "-q").code == 0
        with Path(f"{folder}/out.csv").open(newline="", encoding="utf-8") as file:
            cells = list(csv.DictReader(file))
    expected = expected_long(plant)
    rows = table.rows(named=True)
    assert [(row["frame.number"], row["list"], row["list_name"], row["variable"]) for row in rows] == [
        one[:4] for one in expected
    ]
    for row, cell, one in zip(rows, cells, expected, strict=True):
        assert same(long_value(row), one[4]), (row, one)
        assert (cell["frame.number"], cell["list"], cell["variable"]) == (str(one[0]), one[1], one[3])
        text = next((cell[kind] for kind in ("integer", "unsigned", "real", "text") if cell[kind]), "")
        if isinstance(one[4], str):
            assert text.removeprefix("'") == visible(one[4])
        elif isinstance(one[4], float):
            assert same(float(text), one[4])
        else:
            assert int(text) == one[4]


@examples(25)
@given(seed=SEEDS)
def test_wide_files_and_notebooks_have_every_value(seed: int) -> None:
    plant = drawn_plant(seed)
    wanted: dict[int, list[Sent]] = defaultdict(list)
    for one in plant.told():
        assert one.list
        wanted[one.list.cob_id].append(one)
    with tempfile.TemporaryDirectory() as folder:
        log, options = plant.write(Path(folder))
        captures = nvscope.open(log, definitions=[option for option in options if option != "--gvl"])
        for cob_id in {entry.cob_id for entry in plant.lists}:
            path = f"{folder}/{cob_id}.parquet"
            assert run("export", log, *options, "--list", str(cob_id), "-w", path, "-q").code == 0
            with warnings.catch_warnings(action="ignore"):
                frame = captures.values(cob_id)
            table = pl.read_parquet(path)
            assert table.columns == frame.columns
            for rows in (table, frame):
                check_wide(rows, wanted[cob_id])


def check_wide(table: pl.DataFrame, wanted: list[Sent]) -> None:
    numbers = [table[name].cast(pl.Int64) if table[name].dtype.is_temporal() else table[name] for name in table.columns]
    told = dict(zip(table.columns, (column.to_list() for column in numbers), strict=True))
    assert told.pop("frame.number") == [one.frame for one in wanted]
    assert told.pop("frame.time") == [one.ts_ns for one in wanted]
    assert told.pop("can.channel") == [one.channel for one in wanted]
    assert told.pop("can.id") == [one.cob_id for one in wanted]
    for row, one in enumerate(wanted):
        found = {name: column[row] for name, column in told.items() if column[row] is not None}
        kept = {name: value for name, value in one.values.items() if not beyond(one, name)}
        assert len(found) == len(kept), (found, kept)
        for name, value in kept.items():
            # A second definition's variable of the same name and another type has its type behind it.
            assert any(same(found.get(column), value) for column in found if column.startswith(name)), (name, found)


@examples(25)
@given(seed=SEEDS)
def test_fields_of_packets_have_every_value(seed: int) -> None:
    plant = drawn_plant(seed)
    with tempfile.TemporaryDirectory() as folder:
        log, options = plant.write(Path(folder))
        for entry in {entry.cob_id: entry for entry in plant.lists}.values():
            for element in entry.elements[:4]:
                name = f"var.{entry.name}.{element.name}"
                ran = run("packets", log, *options, "-T", "ndjson", "-e", "frame.number", "-e", name, "-e", "can.id")
                if ran.code == 2:
                    # Or all its frames have the size that an earlier definition gives them.
                    assert "with different types" in ran.err or f"no field is called {name}" in ran.err
                    continue
                assert ran.code == 0
                rows = ran.records()
                assert [row["frame.number"] for row in rows] == [one.frame for one in plant.sent]
                name = list(rows[0])[1] if rows else name
                assert name.removesuffix("_ns") == f"var.{entry.name}.{element.name}"
                for row, one in zip(rows, plant.sent, strict=True):
                    there = one.list is not None and one.list.name == entry.name and element.name in one.values
                    if not there or beyond(one, element.name):
                        assert row[name] is None
                    else:
                        assert as_record(one, element.name, row[name]), (row, one)


def as_record(one: Sent, name: str, told: Any) -> bool:
    value, kind = one.values[name], type_of(one, name).type
    if isinstance(value, float):
        if not math.isfinite(value):
            return told is None
        return bool(np.float32(told) == np.float32(value)) if kind == "REAL" else same(float(told), value)
    return same(told, iso(value).removesuffix("Z") if kind in DATES else value)


@examples(25)
@given(seed=SEEDS)
def test_vars_has_the_last_values_and_counts_changes(seed: int) -> None:
    plant = drawn_plant(seed)
    with tempfile.TemporaryDirectory() as folder:
        log, options = plant.write(Path(folder))
        document = run("vars", log, *options, "--json").document()
        at_end = run("vars", log, *options, "--json", "--at", f"#{len(plant.sent)}").document()
    streams: dict[tuple[str, int, str], list[Sent]] = defaultdict(list)
    last: dict[tuple[str, int], Sent] = {}
    for one in plant.told():
        last[key_of(one), one.cob_id] = one
        for name in one.values:
            assert one.list
            streams[key_of(one), one.cob_id, name].append(one)
    found = {
        (row["list"], int(row["list"].rsplit("/", 1)[1]) + row["subindex"], row["name"]): row
        for row in document["variables"]
    }
    expected = {(*place, name): one for place, one in last.items() for name in one.values}
    assert found.keys() == expected.keys()
    for place, row in found.items():
        one = expected[place]
        assert row["value"] == in_its_unit(one, place[2])
        assert (row["last_ns"], row["packing"]) == (str(one.ts_ns), "assumed")
        own = [entry for entry in streams[place] if entry.list is one.list]
        if own == streams[place]:  # else another definition took over, and counts begin anew
            values = [entry.values[place[2]] for entry in own]
            assert row["telegrams"] == len(own)
            if not isinstance(values[0], float):  # of which several bit patterns may be one value
                assert row["changes"] == sum(before != after for before, after in pairwise(values))
    told = {
        (row["list"], int(row["list"].rsplit("/", 1)[1]) + row["subindex"], row["name"]): row
        for row in at_end["variables"]
        if row["text"] is not None
    }
    assert {place: row["value"] for place, row in told.items()} == {place: row["value"] for place, row in found.items()}


@examples(15)
@given(seed=SEEDS)
def test_the_history_of_all_telegrams_has_every_value(seed: int) -> None:
    plant = drawn_plant(seed)
    with tempfile.TemporaryDirectory() as folder:
        log, options = plant.write(Path(folder))
        document = run("vars", log, *options, "--json", "--history", "*", "--all").document()
    told = [(row["frame"], row["list"], row["name"], row["new"]) for row in document["changes"]]
    expected = [(one.frame, key_of(one), name, in_its_unit(one, name)) for one in plant.told() for name in one.values]
    assert told == expected
