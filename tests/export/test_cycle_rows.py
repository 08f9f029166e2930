"""Rows by cycle against a loop in plain Python, and the program on a list that is not packed."""

from __future__ import annotations

import json
import struct
from collections.abc import Collection
from itertools import pairwise
from pathlib import Path
from typing import Any

import polars as pl
import pyarrow as pa
from hypothesis import given
from hypothesis import strategies as st

from nvscope.export.arrays import LABEL, MOMENT
from nvscope.export.cycle_rows import USUAL_GAP_NS, CycleRows
from tests.definition.lists import telegram
from tests.export.given import written
from tests.laws import examples
from tests.program import run_text

SENDERS = ["10.0.0.1", "10.0.0.2", "10.0.0.3"]
SCHEMA = pa.schema(
    [
        pa.field("frame.time", MOMENT), pa.field("frame.number", pa.int64()), pa.field("ip.src", LABEL),
        pa.field("nv.subindex", pa.uint16()), pa.field("a", pa.int32()), pa.field("b", pa.string()),
        pa.field("b.name", LABEL), pa.field("t", pa.duration("ns")),
    ]
)  # fmt: skip
Row = dict[str, Any]
# Null where one of these SubIndexes stands was sent: a number without a name, or a time that no column holds.
SENT = {"b.name": {1, 2}, "t": {3}}


def table(rows: list[Row]) -> Any:
    names = [name for name in SCHEMA.names if name != "ip.src"]
    columns = [pa.array([row[name] for row in rows], SCHEMA.field(name).type) for name in names]
    numbers = pa.array([row["ip.src"] for row in rows], pa.int32())
    columns.insert(2, pa.DictionaryArray.from_arrays(numbers, SENDERS))
    return pa.table(columns, schema=SCHEMA)


def plain(rows: list[Row], gap_ns: int, recordings_from: Collection[int] = ()) -> list[Row]:
    """Return the rows of cycles: those that ended, in the order in which the next ones began, then the open ones."""
    done: list[Row] = []
    known_from: dict[int, int] = {}
    opened: dict[int, Row] = {}
    last: dict[int, Row] = {}
    for row in rows:
        sender, before = row["ip.src"], last.get(row["ip.src"])
        recording = sum(begin <= row["frame.number"] for begin in recordings_from)
        goes_on = known_from.get(sender) == recording
        known_from[sender] = recording
        together = (
            before is not None
            and goes_on
            and row["nv.subindex"] > before["nv.subindex"]
            and 0 <= row["frame.time"] - before["frame.time"] <= gap_ns
        )
        values = {
            name: row[name]
            for name in ("a", "b", "b.name", "t")
            if row[name] is not None or row["nv.subindex"] in SENT.get(name, ())
        }
        if together:
            opened[sender]["nv.telegrams"] += 1
            opened[sender] |= values
        else:
            carried = dict.fromkeys(("a", "b", "b.name", "t"))
            if sender in opened:
                carried = {name: opened[sender][name] for name in carried} if goes_on else carried
                done.append(opened[sender])
            head = {"frame.time": row["frame.time"], "frame.number": row["frame.number"], "ip.src": SENDERS[sender]}
            opened[sender] = {**head, "nv.telegrams": 1, **carried, **values}
        last[sender] = row
    return done + sorted(opened.values(), key=lambda row: int(row["frame.number"]))


@st.composite
def telegrams(draw: st.DrawFn) -> list[Row]:
    time_ns, found = 1_700_000_000_000_000_000, []
    for number in range(draw(st.integers(1, 40))):
        time_ns += draw(st.sampled_from([0, 1_000, 3_000_000, 12_000_000, -1, 1_000_000_000]))
        present = draw(st.sampled_from(["a", "b", "t", ""]))
        text = draw(st.sampled_from(["x", "=y", ""]))
        found.append(
            {
                "frame.time": time_ns, "frame.number": number + 1, "ip.src": draw(st.integers(0, 2)),
                "nv.subindex": draw(st.integers(0, 4)), "a": number if present == "a" else None,
                "b": text if present == "b" else None, "b.name": text if present == "b" else None,
                "t": number * 1_000 if present == "t" else None,
            }
        )  # fmt: skip
    return found


@examples(300)
@given(
    rows=telegrams(), cuts=st.lists(st.integers(0, 40), max_size=5), interval=st.sampled_from([None, 5_000_000]),
    recordings=st.lists(st.integers(2, 40), max_size=3),
)  # fmt: skip
def test_any_cut_gives_the_rows_of_a_plain_loop(
    rows: list[Row], cuts: list[int], interval: int | None, recordings: list[int]
) -> None:
    cycles = CycleRows(SCHEMA, interval, SENT, recordings_from=lambda: sorted(recordings))
    bounds = [0, *sorted(cuts), len(rows)]
    parts = [cycles.take(table(rows[low:high])) for low, high in pairwise(bounds) if low < high]
    found = pa.concat_tables([*parts, cycles.finish()], promote_options="default")
    assert found.schema.names == ["frame.time", "frame.number", "ip.src", "nv.telegrams", "a", "b", "b.name", "t"]
    numbers = found.set_column(0, "frame.time", found.column(0).cast(pa.int64()))
    numbers = numbers.set_column(7, "t", numbers.column(7).cast(pa.int64()))
    assert numbers.to_pylist() == plain(rows, interval // 2 if interval else USUAL_GAP_NS, recordings)


def test_a_list_that_is_not_packed_by_cycle(tmp_path: Path) -> None:
    """Three telegrams a cycle become one row, without holes from the first whole cycle on."""
    declared = "VAR_GLOBAL bRun : BOOL; nSpeed : INT; tRun : TIME; END_VAR"
    (tmp_path / "flags.gvl").write_text(
        f"<GVL><Declarations>{declared}</Declarations><NetvarSettings Protocol='UDP'><ListIdentifier>5</ListIdentifier>"
        "<Pack>False</Pack><CyclicTransmission>True</CyclicTransmission><Interval>T#100ms</Interval>"
        "</NetvarSettings></GVL>"
    )
    frames = [
        telegram(data, 1, subindex=subindex, counter=cycle + 1, ts_ns=at_ns, list_id=5)
        for cycle in range(4)
        for subindex, data in enumerate([b"\1", struct.pack("<h", cycle), struct.pack("<I", 50 * cycle)])
        for at_ns in [1_700_000_000_000_000_000 + cycle * 100_000_000 + subindex * 1_000_000]
        if (cycle, subindex) != (2, 1)
    ]
    capture = written(tmp_path, frames)
    done = run_text("export", capture, "flags.gvl", "--rows", "cycle", "-w", "o.csv", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    rows = pl.read_csv(tmp_path / "o.csv")
    assert rows.columns == [
        "frame.time", "frame.number", "ip.src", "nv.telegrams", "bRun", "nSpeed", "tRun_ns",
    ]  # fmt: skip
    assert rows.select("frame.number", "nv.telegrams", "nSpeed", "tRun_ns").rows() == [
        (1, 3, 0, 0), (4, 3, 1, 50_000_000), (7, 2, 1, 100_000_000), (9, 3, 3, 150_000_000),
    ]  # fmt: skip
    both = ("--rows", "cycle", "--form", "long")
    done = run_text("export", capture, "flags.gvl", *both, "-w", "o.csv", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("nvscope: --rows cycle is for --form wide\n")


def test_a_cycle_has_no_values_of_the_recording_before(tmp_path: Path) -> None:
    """Where the second one begins inside a cycle, what was sent in front of it is not known."""
    declared = "VAR_GLOBAL bRun : BOOL; nSpeed : INT; END_VAR"
    (tmp_path / "flags.gvl").write_text(
        f"<GVL><Declarations>{declared}</Declarations><NetvarSettings Protocol='UDP'><ListIdentifier>5</ListIdentifier>"
        "<Pack>False</Pack><Interval>T#100ms</Interval></NetvarSettings></GVL>"
    )
    frames = [
        telegram(data, 1, subindex=subindex, counter=cycle + 1, ts_ns=at_ns, list_id=5)
        for cycle in range(4)
        for subindex, data in enumerate([bytes([cycle % 2]), struct.pack("<h", cycle)])
        for at_ns in [1_700_000_000_000_000_000 + cycle * 100_000_000 + subindex * 1_000_000 + cycle // 2 * 10**14]
    ]
    captures = [written(tmp_path, part, name) for part, name in ((frames[:4], "a.pcap"), (frames[5:], "b.pcap"))]
    done = run_text("export", *captures, "flags.gvl", "--rows", "cycle", "-w", "-.ndjson", cwd=tmp_path)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(row["nv.telegrams"], row["bRun"], row["nSpeed"]) for row in rows] == [
        (2, False, 0), (2, True, 1), (1, None, 2), (2, True, 3),
    ]  # fmt: skip


def test_what_has_no_name_does_not_have_that_of_the_cycle_before(tmp_path: Path) -> None:
    declared = "VAR_GLOBAL e : (A, B := 5, C); n : INT; END_VAR"
    (tmp_path / "mode.gvl").write_text(
        f"<GVL><Declarations>{declared}</Declarations><NetvarSettings Protocol='UDP'><ListIdentifier>5</ListIdentifier>"
        "<Pack>True</Pack><Interval>T#100ms</Interval></NetvarSettings></GVL>"
    )
    frames = [
        telegram(struct.pack("<hh", mode, number), 2, subindex=0, counter=number + 1, ts_ns=at_ns, list_id=5)
        for number, mode in enumerate([0, 5, 7, 6])
        for at_ns in [1_700_000_000_000_000_000 + number * 100_000_000]
    ]
    capture = written(tmp_path, frames)
    done = run_text("export", capture, "mode.gvl", "--rows", "cycle", "-w", "-", cwd=tmp_path)
    assert [row.rpartition("1,")[2] for row in done.stdout.splitlines()[1:]] == ["0,A,0", "5,B,1", "7,,2", "6,C,3"]


def test_bytes_of_several_telegrams_are_no_column_of_cycles(tmp_path: Path) -> None:
    """How many telegrams an array of unknown bounds takes, nobody knows: a row would have the bytes of the last."""
    declared = "VAR_GLOBAL p : POINTER TO INT; arr : ARRAY[0..N] OF WORD; last : DINT; END_VAR"
    (tmp_path / "open.gvl").write_text(
        f"<GVL><Declarations>{declared}</Declarations><NetvarSettings Protocol='UDP'><ListIdentifier>5</ListIdentifier>"
        "<Pack>False</Pack><Interval>T#100ms</Interval></NetvarSettings></GVL>"
    )
    frames = [
        telegram(data, 1, subindex=subindex, counter=1, ts_ns=1_700_000_000_000_000_000 + subindex * 10_000, list_id=5)
        for subindex, data in enumerate([b"\1\2", b"\7\0", b"\x08\0", b"\1\0\0\0"])
    ]
    capture = written(tmp_path, frames)
    done = run_text("export", capture, "open.gvl", "--rows", "cycle", "-w", "-", cwd=tmp_path)
    assert done.returncode == 0
    assert [row.partition(",")[2] for row in done.stdout.splitlines()] == [
        "frame.number,ip.src,nv.telegrams,p …", "1,10.0.0.1,4,0102",
    ]  # fmt: skip
    assert "open: arr … are bytes of several telegrams, which a row of a cycle does not have" in done.stderr
    assert (
        "open: nobody knows how many bytes arr : ARRAY[0..N] OF WORD has; from there on, bytes are bytes" in done.stderr
    )
    done = run_text("export", capture, "open.gvl", "--rows", "telegram", "-w", "-", cwd=tmp_path)
    assert [row.partition(",10.0.0.1,")[2] for row in done.stdout.splitlines()[1:]] == [
        "0,0102,", "1,,0700", "2,,0800", "3,,01000000",
    ]  # fmt: skip
