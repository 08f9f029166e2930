"""What must hold for any capture with any definitions: every verb answers or refuses in words, and the answers agree.

``ask`` raises AssertionError where something does not hold; any other exception is a bug as well.
"""

from __future__ import annotations

import csv
import json
import random
import warnings
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

import nvscope
from nvscope.errors import ExitCode, UsageError
from tests.fuzz.examination import NAME, assert_printable, ends
from tests.fuzz.program import Ran, run

READ = {ExitCode.GOOD, ExitCode.DATA_LOSS}
REFUSED = {ExitCode.USAGE, ExitCode.UNREADABLE}
EXPRESSIONS = (
    "nv.index == 1", "nv.flags.ack", "list.lost > 0", "list.name == \"axis\"", "list.nSendCount > 3",
    "finding.code == \"NV201\"", "finding.severity == \"error\"", "finding.code in {\"NV405\", \"NV101\", \"NV502\"}",
    "finding.count > 1 && list.id < 10", "node.lost > 0 || nv.subindex == 0", "nv.data[0:2] == 01:02",
    "frame.time_relative < 0.5", "frame.time_delta > 1", "ip.src in {10.0.0.0/8} && !nv.fault", "nv.counter & 1",
    "nv.data contains \"a\"", "finding.message matches \"lost\"",
)  # fmt: skip
TIMES = ("0s", "5s", "-2s", "#1", "#7", "-0.001s", "00:00:01", "2026-01-31 08:00:01.5Z", "100000h", "#999999999")
_CODES = frozenset(int(code) for code in ExitCode)
_MOST_NS = (1 << 63) - 1
_LONG_TIMES = {"LTIME", "LTOD", "LDATE", "LDT"}
_FORMS = ("ndjson", "csv", "parquet")

Key = tuple[str, str, int]
"""List, sender and SubIndex."""


@dataclass(frozen=True)
class Plant:
    """A capture and the definition files that are given with it, by their names."""

    capture: bytes
    definitions: Mapping[str, bytes] = field(default_factory=dict)


@dataclass
class Answered:
    """How far the questions came: what a fuzzer must reach often to be worth its time."""

    readable: bool = False
    defined: bool = False
    telegrams: int = 0
    decoded: int = 0
    values: int = 0
    drafts: int = 0
    runs: int = 0


class _Asked:
    """A plant on disk, and the words that lead to it."""

    def __init__(self, plant: Plant, folder: Path, rng: random.Random) -> None:
        self.folder, self.rng = folder, rng
        self.capture = folder / NAME
        self.capture.write_bytes(plant.capture)
        self.files: list[str] = []
        for name, raw in plant.definitions.items():
            (folder / name).write_bytes(raw)
            self.files.append(str(folder / name))
        # An empty project of its own: none above the working directory is asked.
        self.project = folder / "nvscope.toml"
        self.project.write_text(f"definitions = {json.dumps([Path(one).name for one in self.files])}\n")
        self.answered = Answered()

    def definitions(self) -> list[str]:
        if self.rng.random() < 0.3:
            return ["--project", str(self.project)]
        return [word for file in self.files for word in ("--gvl", file)]

    def run(self, *words: str, printable: bool = True) -> Ran:
        self.answered.runs += 1
        ran = run(*words, width=self.rng.choice((20, 80, 140)))
        assert ran.code in _CODES, ran
        if printable:
            assert_printable(ran.out)
        assert_printable(ran.err)
        if ran.code and words[0] != "gvl":
            assert ran.err, f"ends with {ran.code} and says nothing: {words}"
        return ran

    def on_capture(self, verb: str, *words: str, defined: bool = True, printable: bool = True) -> Ran:
        named = self.definitions() if defined else []
        return self.run(verb, "-q", str(self.capture), *named, *words, printable=printable)


def ask(plant: Plant, folder: Path, rng: random.Random) -> Answered:
    """Ask all verbs; ``rng`` draws in which forms, and with which filters."""
    asked = _Asked(plant, folder, rng)
    with ends():
        _ask_definitions(asked)
        plain = asked.on_capture("report", "--json", defined=False)
        if plain.code not in READ:
            assert plain.code in REFUSED, plain
            assert not plain.out
            return asked.answered
        asked.answered.readable = True
        _ask_inference(asked)
        report = asked.on_capture("report", "--json")
        if report.code not in READ:
            assert report.code == ExitCode.USAGE, report
            _ask_refused(asked)
            return asked.answered
        _compare_reports(plain.document(), report.document())
        asked.answered.telegrams = report.document()["capture"]["telegrams"]
        _ask_filtered(asked, report.document())
        variables = _ask_variables(asked, report.document())
        if variables is not None:
            _ask_exports(asked, variables)
        _ask_notebook(asked, report.document(), variables)
    return asked.answered


def _compare_reports(plain: Any, defined: Any) -> None:
    """A definition names and judges, it never changes what was counted."""
    for name in ("frames", "telegrams", "other_frames", "start_ns", "end_ns"):
        assert plain["capture"][name] == defined["capture"][name]
    ours = {entry["key"]: (entry["diag"], entry["counters"]["lost"]) for entry in plain["lists"]}
    theirs = {entry["key"]: (entry["diag"], entry["counters"]["lost"]) for entry in defined["lists"]}
    assert ours.items() <= theirs.items()


# --- definitions ----------------------------------------------------------------------------------------------------


def _ask_definitions(asked: _Asked) -> None:
    if not asked.files:
        return
    layout = asked.run("gvl", "layout", *asked.files, "--json")
    lint = asked.run("gvl", "lint", *asked.files, *(["--json"] if asked.rng.random() < 0.5 else []))
    assert layout.code in (ExitCode.GOOD, ExitCode.USAGE), layout
    assert lint.code in (ExitCode.GOOD, ExitCode.ASSERTION_FAILED, ExitCode.USAGE), lint
    if ExitCode.USAGE in (layout.code, lint.code):
        assert layout.code == lint.code
        assert layout.err == lint.err
        assert layout.err
        return
    asked.answered.defined = True
    layout.document()
    asked.run("gvl", "layout", *asked.files)
    first, second = asked.files[0], asked.rng.choice(asked.files)
    types = [word for file in asked.files for word in ("--types", file) if file != first]
    same = asked.run("gvl", "diff", first, first, *types)
    if same.code != ExitCode.USAGE:
        # What nobody knows the size of cannot be told to be the same.
        assert same.code == ExitCode.GOOD or "unknown" in same.out or "nobody" in same.out, same
    asked.run("gvl", "diff", first, second, *types, *(["--json"] if asked.rng.random() < 0.5 else []))


def _ask_refused(asked: _Asked) -> None:
    """What is wrong with definitions is said by every verb alike."""
    words = [word for file in asked.files for word in ("--gvl", file)]
    verbs = (["vars"], ["report"], ["packets", "-V"])
    refusals = {asked.run(*verb, "-q", str(asked.capture), *words).err for verb in verbs}
    assert len(refusals) == 1, refusals


# --- filters --------------------------------------------------------------------------------------------------------


def _ask_filtered(asked: _Asked, whole: Any) -> None:
    rng = asked.rng
    expression = rng.choice(EXPRESSIONS)
    names = [row["name"] for entry in whole["lists"] for row in entry.get("values") or ()]
    if names and rng.random() < 0.5:
        name = rng.choice(names).replace(" ", "")
        expression = rng.choice(("var.{}", "var.{} == 1", "var.{} > 0.5", 'var.{} contains "a"', "!var.{}")).format(
            name
        )
    asked.on_capture("report", "-Y", expression, *rng.choice(((), ("--md",), ("-v",))))
    report = asked.on_capture("report", "--json", "-Y", expression)
    chosen = asked.on_capture("packets", "-T", "ndjson", "-Y", expression)
    assert (report.code in READ) == (chosen.code in READ)
    if report.code not in READ:
        return
    _check_part(report.document(), whole)
    assert report.document()["filter"]["telegrams"] == len(chosen.records())
    rest = asked.on_capture("packets", "-T", "ndjson", "-Y", f"!({expression})").records()
    everything = asked.on_capture("packets", "-T", "ndjson", defined=False).records()
    assert len(everything) == whole["capture"]["telegrams"], len(everything)
    frames = sorted(row["frame.number"] for row in [*chosen.records(), *rest])
    if "finding." in expression:
        # A telegram may show a finding that is chosen, and one that is not.
        frames = sorted(set(frames))
    assert frames == [row["frame.number"] for row in everything], expression
    asked.on_capture("packets", "-V", "-c", "30", *rng.choice(((), ("-x",))))
    asked.on_capture("packets", "-c", "30", "-Y", expression)


def _check_part(part: Any, whole: Any) -> None:
    """Rows of a filtered report are rows of the whole one."""
    lists = {entry["key"]: entry for entry in whole["lists"]}
    for entry in part["lists"]:
        full = lists[entry["key"]]
        for name in ("diag", "counters", "name", "port", "id"):
            assert entry[name] == full[name], name
        for name in ("nodes", "streams"):
            assert all(row in full[name] for row in entry[name]), name
        for row in entry.get("values") or ():
            same = [one for one in full["values"] if _row_key(one) == _row_key(row) and one["name"] == row["name"]]
            assert same
            assert row["telegrams"] <= same[0]["telegrams"]
    assert all(finding in whole["findings"] for finding in part["findings"])
    assert part["capture"] == whole["capture"]


def _row_key(row: Any) -> tuple[str, int]:
    return row["sender"], row["subindex"]


# --- variables ------------------------------------------------------------------------------------------------------


def _ask_variables(asked: _Asked, report: Any) -> list[dict[str, Any]] | None:
    """Return the rows of ``vars``; None where no list is defined."""
    rng = asked.rng
    asked.on_capture("vars")
    ran = asked.on_capture("vars", "--json")
    if ran.code not in READ:
        assert ran.code == ExitCode.USAGE, ran
        return None
    rows: list[dict[str, Any]] = ran.document()["variables"]
    streams = {
        (entry["key"], stream["node"], stream["subindex"]): stream["telegrams"]
        for entry in report["lists"]
        for stream in entry["streams"]
    }
    for row in rows:
        if row["sender"] is not None:
            assert row["telegrams"] <= streams[row["list"], row["sender"], row["subindex"]]
            assert row["changes"] <= max(row["telegrams"] - 1, 0)
    asked.answered.decoded = sum(_telegrams_of(rows).values())
    inside = [row for entry in report["lists"] for row in entry.get("values") or ()]
    assert (
        [{name: row[name] for name in inside[0]} for row in rows if row["sender"] is not None]
        == [row for row in inside if row["sender"] is not None]
        if inside
        else True
    )
    _ask_moment(asked, rows, report)
    if rows:
        _ask_history(asked, rng.choice(rows), rows)
    return rows


def _telegrams_of(rows: Sequence[Mapping[str, Any]]) -> dict[Key, int]:
    """Return how many telegrams were decoded; that many for each variable in them."""
    found: dict[Key, int] = {}
    for row in rows:
        if row["sender"] is not None:
            key = row["list"], row["sender"], row["subindex"]
            assert found.setdefault(key, row["telegrams"]) == row["telegrams"]
    return found


def _ask_moment(asked: _Asked, rows: Sequence[Mapping[str, Any]], report: Any) -> None:
    asked.on_capture("vars", "--at", asked.rng.choice(TIMES), *asked.rng.choice(((), ("--json",), ("--utc",))))
    frames = report["capture"]["frames"]
    if not frames:
        return
    last = asked.on_capture("vars", "--at", f"#{frames}", "--json")
    assert last.code in READ, last
    # A variable that nobody has sent has no frame, in ``vars`` no row.
    sent = [row for row in last.document()["variables"] if row["frame"] is not None]
    assert _values_of(sent) == _values_of(rows)


def _values_of(rows: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str, str], Any]:
    return {(row["list"], row["sender"], row["name"]): (row["value"], row["text"]) for row in rows}


def _ask_history(asked: _Asked, row: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> None:
    name, key = row["name"], row["list"]
    listed = ("--list", row["list_name"])
    asked.on_capture("vars", "--history", name, *listed)
    ran = asked.on_capture("vars", "--history", name, "--all", "--json", *listed)
    if ran.code not in READ:
        return  # the name of a list may be another's identifier, or none that can be typed
    told = Counter((one["list"], one["sender"], one["name"]) for one in ran.document()["changes"] if one["list"] == key)
    # What nobody has described has one name in all telegrams of its list.
    wanted: Counter[tuple[str, str, str]] = Counter()
    for one in rows:
        if one["list"] == key and one["name"] == name:
            wanted[one["list"], one["sender"], one["name"]] += one["telegrams"]
    assert +wanted <= told, (wanted, told)


# --- inference ------------------------------------------------------------------------------------------------------


def _ask_inference(asked: _Asked) -> None:
    draft = asked.folder / "draft.gvl"
    ran = asked.on_capture("vars", "--infer", "-w", str(draft), defined=False)
    assert ran.code in READ, ran
    as_json = asked.on_capture("vars", "--infer", "--json", defined=False)
    as_json.document()
    for path in sorted(asked.folder.glob("draft*.gvl"))[:10]:
        again = asked.run("vars", "-q", str(asked.capture), "--gvl", str(path), "--json")
        # A draft that cannot be declared as it was sent says so; there may be nothing in it.
        if "it does not fit the wire" not in ran.err:
            assert again.code in READ, (path.read_text(), again)
            assert any(row["sender"] is not None for row in again.document()["variables"]), path.read_text()
        lint = asked.run("gvl", "lint", str(path))
        assert lint.code in (ExitCode.GOOD, ExitCode.ASSERTION_FAILED), lint
        asked.answered.drafts += 1
    for path in asked.folder.glob("draft*.gvl"):
        path.unlink()


# --- exports --------------------------------------------------------------------------------------------------------


def _ask_exports(asked: _Asked, rows: Sequence[Mapping[str, Any]]) -> None:
    folder = asked.folder / "out"
    folder.mkdir(exist_ok=True)
    telegrams = _telegrams_of(rows)
    variables = Counter((row["list"], row["sender"], row["subindex"]) for row in rows)
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
        assert counted == {key: count * variables[key] for key, count in telegrams.items() if count * variables[key]}
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


def _compare_with_packets(asked: _Asked, long: Sequence[Mapping[str, Any]]) -> None:
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
        told = {row["frame.number"]: row.get(name, row) for row in ran.records() if row.get(name) is not None}
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


# --- notebooks ------------------------------------------------------------------------------------------------------


def _ask_notebook(asked: _Asked, report: Any, rows: Sequence[Mapping[str, Any]] | None) -> None:
    opened = nvscope.open(asked.capture, definitions=asked.files or None)
    assert opened.lists.height == len(report["lists"])
    assert opened.findings.height == len(report["findings"])
    assert opened.streams.height == sum(len(entry["streams"]) for entry in report["lists"])
    assert opened.telegrams().height == report["capture"]["telegrams"]
    variables = Counter((row["list"], row["sender"], row["subindex"]) for row in rows or ())
    wanted = sum(count * variables[key] for key, count in _telegrams_of(rows or ()).items())
    try:
        with warnings.catch_warnings(action="ignore"):  # of what was left out, it is told
            height = opened.values(form="long").height
    except UsageError:
        height = 0  # no list is defined, or none of which the sizes of all variables are known
    assert height == wanted
