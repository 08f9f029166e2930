"""``nvscope export``, as a person types it."""

from __future__ import annotations

import csv
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from tests.definition.lists import telegram
from tests.export.given import defined, written
from tests.program import COMMAND, run_text

CAPTURES = Path(__file__).parents[2] / "captures"
PEERS = CAPTURES / "peers"
CAPTURE = str(PEERS / "peers.pcap")
FILES = ("axis.gvl", "axis_types.st", "batch.gvl", "recipe.gvl", "counters.gvl")
GVL = [word for name in FILES for word in ("--gvl", str(PEERS / name))]
AXIS = GVL[:4]
READERS = {"parquet": pl.read_parquet, "csv": pl.read_csv, "ndjson": pl.read_ndjson}


def nvscope(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return run_text(*arguments, cwd=cwd)


def flattened(name: str, value: Any) -> dict[str, Any]:
    """Return a logged value as the elements it is sent as; arrays of the peers begin at 0."""
    if isinstance(value, dict):
        return {key: part for member in value for key, part in flattened(f"{name}.{member}", value[member]).items()}
    if isinstance(value, list):
        return {key: part for at, item in enumerate(value) for key, part in flattened(f"{name}[{at}]", item).items()}
    return {name: value}


def sent_values() -> dict[int, dict[str, list[Any]]]:
    """Return what the peers logged, by list and element."""
    sent: dict[int, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for log in ("sent-codesys-client.json", "sent-node-red.json"):
        for entry in json.loads((PEERS / log).read_text()):
            for variable, value in entry["v"].items():
                for name, part in flattened(variable, value).items():
                    sent[entry["list"]][name].append(part)
    return sent


def column_of(table: pl.DataFrame, name: str) -> list[Any]:
    """Return the values that were sent of a variable, times in ms as the peers log them."""
    in_ns = f"{name}_ns" in table.columns
    column = table[f"{name}_ns" if in_ns else name].drop_nulls()
    if column.dtype == pl.Duration:
        return column.dt.total_milliseconds().to_list()
    return [value // 1_000_000 for value in column.to_list()] if in_ns else column.to_list()


def is_within(decoded: list[Any], logged: list[Any], ending: str) -> bool:
    """Tell whether the decoded values are a run of the logged ones; the recording may have begun after the first."""

    def same(left: Any, right: Any) -> bool:
        # Texts have as many digits of a REAL as tell it from its neighbours.
        return left == right or (ending != "parquet" and isinstance(left, float) and abs(left - right) < 1e-5)

    starts = range(len(logged) - len(decoded) + 1)
    return any(all(map(same, decoded, logged[start : start + len(decoded)])) for start in starts)


@pytest.mark.parametrize("ending", READERS)
def test_every_value_is_the_one_that_was_sent(tmp_path: Path, ending: str) -> None:
    done = nvscope("export", CAPTURE, *GVL, "-w", f"values.{ending}", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.splitlines() == [
        f"nvscope: values.axis.{ending}: 199 telegrams",
        f"nvscope: values.batch.{ending}: 209 telegrams",
        f"nvscope: values.counters.{ending}: 249 telegrams",
        f"nvscope: values.recipe.{ending}: 156 telegrams",
        "nvscope: 49 data telegrams of lists without a definition left out.",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        f"values.{name}.{ending}" for name in ("axis", "batch", "recipe", "counters")
    )
    names = {42: "axis", 1: "batch", 7: "recipe", 3: "counters"}
    sent = sent_values()
    assert sent
    for list_id, elements in sent.items():
        table = READERS[ending](tmp_path / f"values.{names[list_id]}.{ending}")
        for name, logged in elements.items():
            decoded = column_of(table, name)
            assert 0.9 * len(logged) <= len(decoded) <= len(logged)
            assert is_within(decoded, logged, ending), (list_id, name)


@pytest.mark.parametrize("ending", READERS)
def test_one_list_is_one_file_of_just_that_name(tmp_path: Path, ending: str) -> None:
    done = nvscope("export", CAPTURE, *GVL, "--list", "AXIS", "-w", f"a.{ending}", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert [path.name for path in tmp_path.iterdir()] == [f"a.{ending}"]
    table = READERS[ending](tmp_path / f"a.{ending}")
    assert (table.height, table.columns[:6]) == (
        199, ["frame.time", "frame.number", "ip.src", "nv.subindex", "bStart", "nSpeed"],
    )  # fmt: skip


@pytest.mark.parametrize("name", ["42", "1202/42", "udp/1202/42", "axis"])
def test_a_list_by_any_of_its_names(tmp_path: Path, name: str) -> None:
    assert nvscope("export", CAPTURE, *GVL, "--list", name, "-w", "a.parquet", cwd=tmp_path).returncode == 0
    assert pl.read_parquet(tmp_path / "a.parquet").height == 199


def test_all_formats_of_the_long_form_hold_the_same(tmp_path: Path) -> None:
    for ending in READERS:
        done = nvscope("export", CAPTURE, *GVL, "--form", "long", "-w", f"long.{ending}", cwd=tmp_path)
        assert done.returncode == 0
    whole = pl.read_parquet(tmp_path / "long.parquet")
    assert whole["frame.number"].is_sorted()
    kept = ["frame.number", "ip.src", "list", "list_name", "nv.subindex", "variable", "type", "integer", "text"]
    for ending in ("csv", "ndjson"):
        other = READERS[ending](tmp_path / f"long.{ending}", infer_schema_length=None)
        assert other.select(kept).rows() == whole.select(kept).rows()
        assert other["real"].fill_null(0.0).to_list() == whole["real"].fill_null(0.0).to_list()


def test_telegrams_are_written_as_packets_shows_them(tmp_path: Path) -> None:
    for ending, kind in (("csv", "csv"), ("ndjson", "ndjson")):
        assert nvscope("export", CAPTURE, "-w", f"t.{ending}", cwd=tmp_path).returncode == 0
        shown = nvscope("packets", CAPTURE, "-T", kind, cwd=tmp_path).stdout
        assert (tmp_path / f"t.{ending}").read_text() == shown
    assert nvscope("export", CAPTURE, "-w", "t.parquet", cwd=tmp_path).returncode == 0
    table, lines = pl.read_parquet(tmp_path / "t.parquet"), pl.read_ndjson(tmp_path / "t.ndjson")
    numbers = [name for name, kind in table.schema.items() if kind.is_integer()]
    assert pl.read_csv(tmp_path / "t.csv").select(numbers).rows() == table.select(numbers).rows()
    assert table.columns == lines.columns
    for name in table.columns:
        column = table[name]
        if column.dtype == pl.Binary:
            column = column.bin.encode("hex")
        elif name == "frame.time":
            column = column.dt.strftime("%Y-%m-%dT%H:%M:%S.%9fZ")
        assert column.to_list() == lines[name].to_list(), name


def test_chosen_fields_of_telegrams(tmp_path: Path) -> None:
    arguments = ["-e", "nv.counter", "-e", "ip.src", "-e", "frame.time_delta", "-e", "nv.data"]
    done = nvscope("export", CAPTURE, *arguments, "-w", "t.parquet", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    table = pl.read_parquet(tmp_path / "t.parquet")
    assert table.columns == ["nv.counter", "ip.src", "frame.time_delta", "nv.data"]
    assert table.schema["frame.time_delta"] == pl.Duration("ns")
    assert table.height == 862


def test_no_cell_of_a_csv_file_is_a_formula(tmp_path: Path) -> None:
    texts = ["=1+1", "+1", "-1", "@A1", "\t=1", "'q", "fine", 'a,"b"', "", "=1+1"]
    frames = [
        telegram(text.encode().ljust(11, b"\0") + b"\xff\xff", 2, subindex=0, counter=at, ts_ns=at)
        for at, text in enumerate(texts)
    ]
    definition = defined(tmp_path, "list", "sText : STRING(10);\n\tn : INT;")
    arguments = ["export", written(tmp_path, frames), *definition, "-w"]
    assert nvscope(*arguments, "out.csv", cwd=tmp_path).stderr == ""
    with (tmp_path / "out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["sText"] for row in rows] == [
        "'=1+1", "'+1", "'-1", "'@A1", "\\t=1", "''q", "fine", 'a,"b"', "", "'=1+1",
    ]  # fmt: skip
    assert {row["n"] for row in rows} == {"-1"}
    assert nvscope(*arguments, "out.ndjson", cwd=tmp_path).returncode == 0
    lines = (tmp_path / "out.ndjson").read_text().splitlines()
    assert [json.loads(line)["sText"] for line in lines] == texts


@pytest.mark.parametrize("form", ["wide", "long"])
@pytest.mark.parametrize("ending", READERS)
def test_nothing_of_the_list_gives_columns_without_rows(tmp_path: Path, ending: str, form: str) -> None:
    source = str(CAPTURES / "telegrams.pcap")
    done = nvscope("export", source, *AXIS, "-w", f"out.{ending}", "--form", form, cwd=tmp_path)
    assert done.returncode == 0
    first, *_ = done.stderr.splitlines()
    assert first.endswith(f"no telegram of a defined list; out.{ending} has columns, but no rows.")
    if ending == "parquet":
        table = pl.read_parquet(tmp_path / "out.parquet")
        assert table.height == 0
        assert "frame.time" in table.columns
    elif ending == "csv":
        (heading,) = (tmp_path / "out.csv").read_text().splitlines()
        assert heading.startswith("frame.time,frame.number,")
    else:
        assert (tmp_path / "out.ndjson").read_text() == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([CAPTURE], ["no file to write", "-w"]),
        ([CAPTURE, "-w", "out.xlsx"], ["out.xlsx", ".xlsx", ".csv", ".ndjson", ".parquet"]),
        ([CAPTURE, "-w", "out"], ["out", ".parquet"]),
        ([CAPTURE, "-w", "out.csv", "--what", "values"], ["no list is defined", "--gvl"]),
        ([CAPTURE, "-w", "out.csv", "--form", "long"], ["no list is defined", "--gvl"]),
        ([CAPTURE, "-w", "out.csv", "-e", "nv.countr"], ["nv.countr", "nv.counter"]),
        ([CAPTURE, "-w", "out.csv", "-e", "nv.index", "--form", "long"], ["--form long is for values"]),
        ([CAPTURE, "-w", "out.csv", "-e", "nv.index", "--what", "values"], ["-e is for telegrams"]),
        ([CAPTURE, *AXIS, "-w", "out.csv", "--what", "telegrams"], ["--gvl names variables"]),
        ([CAPTURE, *AXIS, "-w", "out.csv", "--list", "axes"], ["no list is named 'axes'", "axis (udp/1202/42)"]),
    ],
)
def test_what_cannot_be_done_is_said(tmp_path: Path, arguments: list[str], words: list[str]) -> None:
    done = nvscope("export", *arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert all(word in done.stderr for word in words), done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_written_is_told_before_the_capture_is_read(tmp_path: Path) -> None:
    (tmp_path / "dir.csv").mkdir()
    for name in ("missing/out.csv", "dir.csv"):
        done = nvscope("export", CAPTURE, *AXIS, "-w", name, cwd=tmp_path)
        assert done.returncode == 5
        assert f"{name}: cannot be written" in done.stderr


@pytest.mark.parametrize("ending", READERS)
def test_an_old_file_stays_where_the_new_one_cannot_be_finished(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"out.{ending}"
    path.write_text("old")

    def small() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    command = [*COMMAND, "export", CAPTURE, *AXIS, "-w", path.name]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path, preexec_fn=small)
    assert done.returncode == 5, done.stderr
    assert f"nvscope: {path.name}: cannot be written: File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "old"


def test_a_replaced_file_and_a_link_to_one(tmp_path: Path) -> None:
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    assert nvscope("export", CAPTURE, *AXIS, "-w", "link.csv", cwd=tmp_path).returncode == 0
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text().startswith("frame.time,")


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)], ids=["INT", "TERM", "HUP"]
)
def test_an_interrupted_export_leaves_nothing(number: signal.Signals, code: int, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "nvscope", "export", "-", *AXIS, "-w", "out.parquet"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        assert process.stdin
        process.stdin.write(Path(CAPTURE).read_bytes()[:20_000])
        process.stdin.flush()
        deadline = time.monotonic() + 30
        while not list(tmp_path.iterdir()) and time.monotonic() < deadline:
            time.sleep(0.05)
        (unfinished,) = tmp_path.iterdir()
        assert re.fullmatch(r"\.out\.parquet\.[0-9a-f]{16}\.unfinished\.parquet", unfinished.name)
        process.send_signal(number)
        _, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (code, b"")
    assert not list(tmp_path.iterdir())


def test_a_capture_cut_short_gives_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "cut.pcap").write_bytes(Path(CAPTURE).read_bytes()[:-10])
    done = nvscope("export", "cut.pcap", *AXIS, "-w", "out.parquet", cwd=tmp_path)
    assert done.returncode == 3
    assert "cut.pcap, offset" in done.stderr
    assert pl.read_parquet(tmp_path / "out.parquet").height == 198


def test_an_export_to_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    command = [sys.executable, "-m", "nvscope", "export", CAPTURE, *AXIS, "-q", "-w", "pipe.csv"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        text = (tmp_path / "pipe.csv").read_text()
        assert process.wait(30) == 0
    assert len(text.splitlines()) == 200


def test_types_of_one_list_are_those_of_its_variables(tmp_path: Path) -> None:
    assert nvscope("export", CAPTURE, *AXIS, "-w", "out.parquet", cwd=tmp_path).returncode == 0
    schema = pl.read_parquet(tmp_path / "out.parquet").schema
    assert dict(schema) == {
        "frame.time": pl.Datetime("ns", "UTC"), "frame.number": pl.Int64(), "ip.src": pl.String(),
        "nv.subindex": pl.UInt16(), "bStart": pl.Boolean(), "nSpeed": pl.Int16(), "fTemp": pl.Float32(),
        "stAxis.pos": pl.Float64(), "stAxis.vel": pl.Float32(), **{f"aLimits[{at}]": pl.Int32() for at in range(4)},
        "sText": pl.String(), "eState": pl.Int16(),
    }  # fmt: skip
