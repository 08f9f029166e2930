"""``nvscope export`` of lists whose definition is not the whole truth, and of values that not every form can hold."""

from __future__ import annotations

import csv
import json
import math
import os
import struct
import subprocess
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from nvscope import open as open_captures
from tests.cli.test_export import AXIS, CAPTURES, READERS, nvscope
from tests.export.given import defined, numbered, written
from tests.program import COMMAND


def test_that_telegrams_came_is_not_denied_where_none_could_be_written(tmp_path: Path) -> None:
    capture = written(tmp_path, numbered([b"\1\0", b"\2\0"], 1))
    fits, other = defined(tmp_path, "fits", "n : INT;"), defined(tmp_path, "other", "n : DINT;")
    told = {
        "n": nvscope("export", capture, *other, "-w", "n.csv", cwd=tmp_path).stderr,
        "y": nvscope("export", capture, *fits, "-Y", "nv.index == 8", "-w", "y.csv", cwd=tmp_path).stderr,
        "b": nvscope("export", capture, *other, "-Y", "nv.counter == 1", "-w", "b.csv", cwd=tmp_path).stderr,
        "f": nvscope("export", str(CAPTURES / "telegrams.pcap"), *AXIS, "-w", "f.csv", cwd=tmp_path).stderr,
    }
    first = {name: text.splitlines()[0].removeprefix("nvscope: ") for name, text in told.items()}
    columns = ".csv has columns, but no rows."
    assert first["n"] == f"2 frames, none of 2 telegrams of defined lists could be decoded; n{columns}"
    assert first["y"] == f"the filter chooses none of 2 telegrams of defined lists; y{columns}"
    one = "the one telegram of a defined list that the filter chooses"
    assert first["b"] == f"2 frames, and {one} could not be decoded; b{columns}"
    assert "no telegram of a defined list; " in first["f"]
    assert "other: 2 telegrams left out, not of the shape that the definition has (NV405)." in told["n"]


@pytest.mark.parametrize("ending", READERS)
def test_of_a_list_with_a_pointer_there_is_what_is_known(tmp_path: Path, ending: str) -> None:
    pointer = defined(tmp_path, "plant", "n : INT;\n\tp : POINTER TO INT;\n\tq : INT;")
    frames = numbered([b"\5\0" + b"\xaa" * size for size in (6, 10)], 3) + numbered([b"\xbb"], 1, subindex=1)
    capture = written(tmp_path, [*frames, *numbered([b"\1"], 3)])
    done = nvscope("export", capture, *pointer, "--list", "plant", "-w", f"o.{ending}", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == (
        "nvscope: udp/1202/7 plant: 1 telegram left out, "
        "not even of the shape that the known part of the definition has.\n"
    )
    table = READERS[ending](tmp_path / f"o.{ending}")
    rest = table["p …"].bin.encode("hex") if ending == "parquet" else table["p …"]
    assert table["n"].to_list() == [5, 5, None]
    assert [str(one) for one in rest] == ["aa" * 6, "aa" * 10, "bb"]
    assert table["nv.subindex"].to_list() == [0, 0, 1]
    everything = nvscope("export", capture, *pointer, "--form", "long", "-w", f"l.{ending}", cwd=tmp_path)
    assert "nobody knows how many bytes p : POINTER has" in everything.stderr
    long = READERS[ending](tmp_path / f"l.{ending}")
    assert long["variable"].to_list() == ["n", "p …", "n", "p …", "p …"]


def test_each_telegram_is_decoded_by_the_definition_that_it_fits(tmp_path: Path) -> None:
    short = defined(tmp_path, "short", "n : INT;\n\te : DINT;")
    long = defined(tmp_path, "long", "n : INT;\n\te : LREAL;\n\tb : BOOL;")
    frames = numbered([struct.pack("<hi", 1, 2)], 2) + numbered([struct.pack("<hd?", 3, 4.5, True)], 3)
    capture = written(tmp_path, frames)
    for name in ("short", "LONG", "7"):
        done = nvscope("export", capture, *short, *long, "--list", name, "-w", "o.parquet", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
    table = pl.read_parquet(tmp_path / "o.parquet")
    assert table.select("n", "e : DINT", "e", "b").rows() == [(1, 2, None, None), (3, None, 4.5, True)]
    nvscope("export", capture, *short, *long, "--form", "long", "-w", "l.parquet", cwd=tmp_path)
    below = pl.read_parquet(tmp_path / "l.parquet")
    assert below.select("list_name", "variable", "type").rows() == [
        ("short", "n", "INT"), ("short", "e", "DINT"),
        ("long", "n", "INT"), ("long", "e", "LREAL"), ("long", "b", "BOOL"),
    ]  # fmt: skip


def test_times_have_one_form_and_what_it_cannot_hold_is_told(tmp_path: Path) -> None:
    names = {"t": "TIME", "lt": "LTIME", "od": "TOD", "lod": "LTOD", "d": "DATE", "ld": "LDATE", "m": "DT", "lm": "LDT"}
    gvl = defined(tmp_path, "times", "\n\t".join(f"v_{name} : {kind};" for name, kind in names.items()))
    rows = [(1500, long, 1000, long, 86_400, long, 86_400, long) for long in (86_400 * 10**9, 2**63 + 1, 2**63 - 1)]
    capture = written(tmp_path, numbered([struct.pack("<IQIQIQIQ", *row) for row in rows], 8))
    done = nvscope("export", capture, *gvl, "-w", "o.parquet", cwd=tmp_path)
    assert done.stderr == (
        "nvscope: o.parquet: 4 times of 64 bits are beyond 292 years or the year 2262, and null; the long form has the "
        "nanoseconds.\n"
    )
    table = pl.read_parquet(tmp_path / "o.parquet").select(pl.col("^v_.*$"))
    kinds = {"t": pl.Duration("ns"), "o": pl.Duration("ns"), "d": pl.Datetime("ns"), "m": pl.Datetime("ns")}
    assert table.dtypes == [kinds[name.replace("l", "", 1)[0]] for name in names]
    numbers = table.select(pl.all().cast(pl.Int64))
    assert numbers["v_lt"].to_list() == numbers["v_ld"].to_list() == [86_400 * 10**9, None, 2**63 - 1]
    assert numbers["v_t"].to_list() == [1_500_000_000] * 3
    named = [word for name in ("lt", "od", "lod", "lm") for word in ("-e", f"var.v_{name}")]
    for ending in ("parquet", "csv", "ndjson"):
        done = nvscope("export", capture, *gvl, *named, "-w", f"t.{ending}", cwd=tmp_path)
        assert done.stderr.startswith(f"nvscope: t.{ending}: 3 times of 64 bits are beyond 292 years"), done.stderr
    for form in ("fields", "csv", "json", "ndjson"):
        done = nvscope("packets", capture, *gvl, *named, "-T", form, cwd=tmp_path)
        assert done.stderr.startswith("nvscope: 3 times of 64 bits are beyond 292 years"), done.stderr
    assert nvscope("packets", capture, *gvl, *named, "-Y", "frame.number == 1", cwd=tmp_path).stderr == ""
    opened = open_captures(tmp_path / capture, definitions=tmp_path / gvl[1])
    with pytest.warns(UserWarning, match=r"^3 times of 64 bits are beyond .* values\(form='long'\)"):
        opened.telegrams(*(word for word in named if word != "-e"))
    for ending in ("csv", "ndjson"):
        nvscope("export", capture, *gvl, "-w", f"o.{ending}", cwd=tmp_path)
    for read in (pl.read_csv(tmp_path / "o.csv"), pl.read_ndjson(tmp_path / "o.ndjson")):
        # Without a type of their own, durations have their unit in the name.
        assert read.columns[4:] == ["v_t_ns", "v_lt_ns", "v_od_ns", "v_lod_ns", "v_d", "v_ld", "v_m", "v_lm"]
        for name in ("t", "lt", "od", "lod"):
            assert read[f"v_{name}_ns"].to_list() == numbers[f"v_{name}"].to_list()
        assert read["v_lm"].to_list() == ["1970-01-02T00:00:00.000000000", None, "2262-04-11T23:47:16.854775807"]
    assert nvscope("export", capture, *gvl, "--form", "long", "-w", "l.parquet", cwd=tmp_path).stderr == ""
    long = pl.read_parquet(tmp_path / "l.parquet").filter(pl.col("variable") == "v_lt")
    assert long.select("integer", "unsigned").rows() == [(86_400 * 10**9, None), (None, 2**63 + 1), (2**63 - 1, None)]
    for kind in ("json", "ndjson"):
        shown = nvscope("packets", capture, *gvl, "-e", "var.v_lt", "-T", kind, cwd=tmp_path).stdout
        found = json.loads(shown) if kind == "json" else [json.loads(line) for line in shown.splitlines()]
        assert [one["var.v_lt_ns"] for one in found] == numbers["v_lt"].to_list()
    chosen = nvscope("packets", capture, *gvl, "-Y", "var.v_lt > 1s", "-e", "frame.number", cwd=tmp_path).stdout
    assert chosen.split() == ["1", "3"]


def test_texts_and_numbers_are_written_alike_everywhere(tmp_path: Path) -> None:
    gvl = defined(tmp_path, "plant", "s : STRING(7);\n\tr : REAL;\n\tm : ARRAY[0..1, 0..0] OF INT;")
    texts, reals = [b"a\tb", b"a\\tb", b'"=', b"=1,2"], [1.5, math.nan, math.inf, -math.inf]
    data = [struct.pack("<8sfhh", text, real, 1, 2) for text, real in zip(texts, reals, strict=True)]
    capture = written(tmp_path, numbered(data, 4))
    nvscope("export", capture, *gvl, "-w", "o.csv", cwd=tmp_path)
    with (tmp_path / "o.csv").open(newline="") as file:
        exported = [(row["s"], row["r"], row["m[1, 0]"]) for row in csv.DictReader(file)]
    names = ["-e", "var.s", "-e", "var.r", "-e", "var.m[1, 0]"]
    shown = nvscope("packets", capture, *gvl, "-T", "csv", *names, cwd=tmp_path).stdout
    heading, *rows = csv.reader(shown.splitlines())
    assert heading == ["var.s", "var.r", "var.m[1,0]"]
    assert [tuple(row) for row in rows] == exported
    assert exported == [("a\\tb", "1.5", "2"), ("a\\\\tb", "NaN", "2"), ('"=', "inf", "2"), ("'=1,2", "-inf", "2")]
    separated = nvscope("packets", capture, *gvl, *names, cwd=tmp_path).stdout.splitlines()
    assert separated == ["a\\tb\t1.5\t2", "a\\\\tb\tNaN\t2", '"=\tinf\t2', "=1,2\t-inf\t2"]
    nvscope("export", capture, *gvl, "-w", "o.ndjson", cwd=tmp_path)
    lines = [json.loads(line) for line in (tmp_path / "o.ndjson").read_text().splitlines()]
    assert [line["s"].encode() for line in lines] == texts
    assert [line["r"] for line in lines] == [1.5, None, None, None]


def test_a_duration_has_one_unit_in_all_data(tmp_path: Path) -> None:
    """What vars, history and export say of a TIME is the same number, and each says that it is nanoseconds."""
    gvl = defined(tmp_path, "plant", "t : TIME;\n\tn : INT;")
    capture = written(tmp_path, numbered([struct.pack("<Ih", 1500, 7), struct.pack("<Ih", 1750, 8)], 2))
    last = json.loads(nvscope("vars", capture, *gvl, "--json", cwd=tmp_path).stdout)["variables"]
    assert [(row["unit"], row["value"], row["min"], row["max"]) for row in last] == [
        ("ns", 1_750_000_000, 1_500_000_000, 1_750_000_000), (None, 8, 7, 8),
    ]  # fmt: skip
    changes = json.loads(nvscope("vars", capture, *gvl, "--history", "t", "--json", cwd=tmp_path).stdout)["changes"]
    assert [(row["unit"], row["old"], row["new"]) for row in changes] == [
        ("ns", None, 1_500_000_000), ("ns", 1_500_000_000, 1_750_000_000),
    ]  # fmt: skip
    was = json.loads(nvscope("vars", capture, *gvl, "--at", "#1", "--json", cwd=tmp_path).stdout)["variables"]
    assert [(row["unit"], row["value"]) for row in was] == [("ns", 1_500_000_000), (None, 7)]
    nvscope("export", capture, *gvl, "-w", "o.csv", cwd=tmp_path)
    assert pl.read_csv(tmp_path / "o.csv")["t_ns"].to_list() == [1_500_000_000, 1_750_000_000]
    for kind, read in (("csv", pl.read_csv), ("ndjson", pl.read_ndjson)):
        shown = nvscope("packets", capture, *gvl, "-e", "var.t", "-T", kind, cwd=tmp_path).stdout
        assert read(shown.encode())["var.t_ns"].to_list() == [1_500_000_000, 1_750_000_000]


def test_changes_of_reals_have_all_digits_that_count(tmp_path: Path) -> None:
    gvl = defined(tmp_path, "plant", "r : REAL;\n\tl : LREAL;")
    near = np.float32(0.1)
    rows = [(near, 0.1), (np.nextafter(near, np.float32(1)), 0.1 + 0.2), (np.float32(16_777_216), 1e22), (0.0, -0.0)]
    data = [struct.pack("<fd", real, long) for real, long in rows]
    capture = written(tmp_path, numbered(data, 2))
    changes = json.loads(nvscope("vars", capture, *gvl, "--history", "*", "--json", cwd=tmp_path).stdout)["changes"]
    texts = {name: [row["new_text"] for row in changes if row["name"] == name] for name in "rl"}
    assert texts["r"] == ["0.1", "0.10000001", "16777216", "0"]
    assert texts["l"] == ["0.1", "0.30000000000000004", "1e+22", "-0"]


@pytest.mark.parametrize("how", ["", "--form long", "--rows cycle", "--what telegrams"])
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_pandas_is_not_imported_where_it_is_installed(tmp_path: Path, how: str, ending: str) -> None:
    """Arrow asks it by itself, and its import takes longer than the whole of a small export."""
    (tmp_path / "pandas").mkdir()
    (tmp_path / "pandas" / "__init__.py").write_text("open('imported', 'w').close()\nraise ImportError\n", "utf-8")
    words = ["export", str(CAPTURES / "telegrams.pcap"), *([] if "--what" in how else AXIS), *how.split()]
    done = subprocess.run(
        [*COMMAND, *words, "-w", f"out.{ending}"], cwd=tmp_path, capture_output=True, check=False,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob(f"out*.{ending}"))
    assert not (tmp_path / "imported").exists()
