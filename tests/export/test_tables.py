"""Tables of values: rows, order, nulls, and the same values in both forms."""

from __future__ import annotations

import struct
import tracemalloc
from datetime import timedelta
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, assume, given
from hypothesis import strategies as st

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import known_fronts, known_part, pack
from nvscope.definition.scalars import SCALARS, unknown_raw
from nvscope.definition.value import value_of
from nvscope.definition.variables import Enumeration, String, Type, Union
from nvscope.errors import UsageError
from nvscope.export import held as held_module
from nvscope.export import wide as wide_module
from nvscope.export.frames import wide_frame
from nvscope.export.lists import lists_to_write
from nvscope.export.values import paths_of
from nvscope.list_key import ANY_CHANNEL, ListKey
from nvscope.view.rows.defined import LeftOut
from tests.definition.lists import HERE, STATE, UNKNOWN, VARIABLES, list_of, telegram
from tests.export.written import long, telegrams_of, wide
from tests.laws import examples
from tests.oracle.frame import Frame

INT, LREAL, ULINT, TIME, DT = (SCALARS[name] for name in ("INT", "LREAL", "ULINT", "TIME", "DT"))


def sent(entry: ListDefinition, telegrams: list[tuple[int, bytes]]) -> list[Frame]:
    """Return frames of some SubIndexes with data, repeated to the size that each has, a second apart."""
    layouts = pack(entry)
    frames = []
    for number, (place, seed) in enumerate(telegrams):
        layout = layouts[place % len(layouts)]
        size = layout.layout.size_bytes
        data = (seed * size)[:size].ljust(size, b"\0")
        frames.append(
            telegram(
                data, layout.items, subindex=layout.subindex, counter=number, ts_ns=number * 10**9,
                list_id=entry.list_id or 0,
            )
        )  # fmt: skip
    return frames


def values_of(entry: ListDefinition, frame: Frame) -> dict[str, tuple[Type, Any]]:
    """Return what ``value_of`` says of a telegram, by variable."""
    payload = frame.data[42:]
    layout = pack(entry)[int.from_bytes(payload[10:12], "little")]
    return {
        element.name: (element.type, value_of(element.type, payload[20 + at : 20 + at + element.type.size_bytes]))
        for at, element in layout.spans()
    }


def equal(left: Any, right: Any) -> bool:
    return left == right or (isinstance(left, float) and isinstance(right, float) and isnan(left) and isnan(right))


TELEGRAMS = st.lists(st.tuples(st.integers(0, 40), st.binary(min_size=1, max_size=12)), min_size=1, max_size=30)


@examples(40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(VARIABLES, st.booleans(), TELEGRAMS, st.integers(1, 12))
def test_both_forms_hold_every_value_in_the_order_of_the_capture(
    tmp_path: Path, types: list[Type], packed: bool, telegrams: list[tuple[int, bytes]], batch_frames: int
) -> None:
    entry = list_of(types, pack=packed)
    frames = sent(entry, telegrams)
    (table,) = wide(frames, [entry], tmp_path, batch_frames)
    assert table["frame.number"].to_list() == list(range(1, len(frames) + 1))
    assert table["frame.time"].dt.timestamp("ns").to_list() == [frame.ts_ns for frame in frames]
    variables = [column for column in table.columns if column.startswith("v") and not column.endswith(".name")]
    below = long(frames, [entry], tmp_path, batch_frames).rows(named=True)
    for row, frame in zip(table.rows(named=True), frames, strict=True):
        expected = values_of(entry, frame)
        assert row["nv.subindex"] == int.from_bytes(frame.data[52:54], "little")
        for name in variables:
            kind, value = expected.get(name, (None, None))
            if kind is not None and getattr(kind, "unit_ns", 0):
                assert row[name] // timedelta(milliseconds=1) == value
            else:
                assert equal(row[name], value), name
        for name, (kind, value) in expected.items():
            told = below.pop(0)
            assert (told["variable"], told["type"], told["frame.number"]) == (name, kind.name, row["frame.number"])
            assert long_value_is(told, kind, value), (told, value)
    assert not below


def long_value_is(told: dict[str, Any], kind: Any, value: Any) -> bool:
    """Tell whether one column holds the value and the others nothing, but for the name of an ENUM's number."""
    filled = {name: told[name] for name in ("integer", "unsigned", "real", "text", "bytes") if told[name] is not None}
    if isinstance(kind, Enumeration):
        names = [name for name, number in kind.values.items() if number == value]
        return filled == ({"integer": value, "text": names[0]} if names else {"integer": value})
    if isinstance(value, float):
        return filled.keys() == {"real"} and equal(filled["real"], value)
    if isinstance(value, str | bytes):
        return filled == {"text" if isinstance(value, str) else "bytes": value}
    return filled == {"integer": int(value) * (getattr(kind, "unit_ns", 0) or 1)}


def test_however_rows_are_grouped_they_are_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lists = [list_of([INT, LREAL], list_id=1), list_of([String(250), INT, INT, String(300)], list_id=2)]
    frames: list[Frame] = []
    for number in range(300):
        entry = lists[number % 3 == 0]
        frames += sent(entry, [(number % 5, struct.pack("<I", number))])
    whole = wide(frames, lists, tmp_path)
    assert [len(table) for table in whole] == [200, 100]
    sizes = (("GROUP_ROWS", 7), ("HELD_BYTES", 3_000), ("_LEAST_SLAB_BYTES", 64), ("_SLAB_BYTES", 256))
    for name, size in sizes:
        monkeypatch.setattr(wide_module if hasattr(wide_module, name) else held_module, name, size)
        for one, again in zip(whole, wide(frames, lists, tmp_path, 11), strict=True):
            assert one.equals(again)


def test_a_list_in_three_telegrams_makes_no_value_up(tmp_path: Path) -> None:
    entry = list_of([String(200), String(200), String(200)])
    frames = sent(entry, [(0, b"a"), (2, b"c"), (1, b"b"), (0, b"d")])
    (table,) = wide(frames, [entry], tmp_path)
    assert table["nv.subindex"].to_list() == [0, 2, 1, 0]
    assert [table[f"v{place}"].str.slice(0, 1).to_list() for place in range(3)] == [
        ["a", None, None, "d"],
        [None, None, "b", None],
        [None, "c", None, None],
    ]


def test_an_unpacked_list_has_a_row_a_variable(tmp_path: Path) -> None:
    entry = list_of([INT, INT, STATE], pack=False)
    (table,) = wide(sent(entry, [(0, b"\1"), (1, b"\2"), (2, b"\1\0")]), [entry], tmp_path)
    assert table.select("v0", "v1", "v2", "v2.name").rows() == [
        (257, None, None, None),
        (None, 514, None, None),
        (None, None, 1, "eRun"),
    ]


def test_an_unpacked_list_of_many_variables_takes_little_memory(tmp_path: Path) -> None:
    entry = list_of([INT] * 2_000, pack=False)
    frames = sent(entry, [(place, bytes([place % 251])) for place in range(2_000)])
    tracemalloc.start()
    (table,) = wide(frames, [entry], tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 100 << 20
    tracemalloc.stop()
    assert table.width == 2_004
    assert table.select(pl.all().exclude("frame.time", "frame.number", "ip.src", "nv.subindex").count()).row(0) == (
        (1,) * 2_000
    )


def test_numbers_of_64_bits_times_and_bytes_are_exact(tmp_path: Path) -> None:
    entry = list_of([ULINT, LREAL, TIME, DT, UNKNOWN])
    data = struct.pack("<QdII4s", 2**64 - 1, 0.1, 2**32 - 1, 1_700_000_000, b"\1\2\3\4")
    frames = [telegram(data, 5, subindex=0, counter=0, ts_ns=1_700_000_000_123_456_789)]
    (table,) = wide(frames, [entry], tmp_path)
    assert table["v0"].to_list() == [2**64 - 1]
    assert table["v1"].to_list() == [0.1]
    assert table.schema["v2"] == pl.Duration("ns")
    assert table["v2"].dt.total_milliseconds().to_list() == [2**32 - 1]
    assert table.schema["v3"] == pl.Datetime("ns")
    assert table["v3"].dt.timestamp("ns").to_list() == [1_700_000_000 * 10**9]
    assert table["v4"].to_list() == [b"\1\2\3\4"]
    assert table["frame.time"].dt.timestamp("ns").to_list() == [1_700_000_000_123_456_789]
    below = long(frames, [entry], tmp_path)
    assert below["unsigned"].drop_nulls().to_list() == [2**64 - 1]
    assert below["integer"].drop_nulls().to_list() == [(2**32 - 1) * 10**6, 1_700_000_000 * 10**9]
    assert below["list"].unique().to_list() == ["udp/1202/7"]


def test_what_cannot_be_told_is_counted(tmp_path: Path) -> None:
    entry = list_of([INT, INT])
    good = telegram(b"\1\0\2\0", 2, subindex=0, counter=1, ts_ns=0)
    other_shape = telegram(b"\1\0", 1, subindex=0, counter=2, ts_ns=1)
    no_such_place = telegram(b"\1\0\2\0", 2, subindex=1, counter=3, ts_ns=2)
    cut = Frame(3, 1, good.data[:-1], good.original)
    header_cut = Frame(4, 1, good.data[:56], good.original)
    wrong_length = Frame(5, 1, good.data[:56] + b"\x19" + good.data[57:], good.original)
    stranger = telegram(b"\1\0", 1, subindex=0, counter=1, ts_ns=6, list_id=8)
    frames = [good, other_shape, no_such_place, cut, header_cut, wrong_length, stranger]
    telegrams, rows = telegrams_of(frames, [entry])
    assert sum(map(len, rows)) == 1
    assert telegrams.left_out == {ListKey.udp(1202, 7): {LeftOut.MALFORMED: 1, LeftOut.UNFITTING: 2, LeftOut.CUT: 2}}
    assert telegrams.undefined == 1


def test_a_choice_of_packets_leaves_the_others_out(tmp_path: Path) -> None:
    entry = list_of([INT])
    frames = sent(entry, [(0, bytes([number])) for number in range(10)])
    _, batches = telegrams_of(frames, [entry], 4, lambda told: np.arange(len(told)) % 2 == 0)
    assert [rows.frame.tolist() for rows in batches] == [[1, 3], [5, 7], [9]]


def test_a_variable_named_as_a_column_keeps_its_value(tmp_path: Path) -> None:
    from tests.records import replace  # noqa: PLC0415

    entry = list_of([INT, STATE, INT])
    names = ("ip.src", "x", "x.name")
    entry = replace(entry, variables=tuple(replace(v, name=n) for v, n in zip(entry.variables, names, strict=True)))
    (table,) = wide([telegram(b"\5\0\1\0\6\0", 3, subindex=0, counter=0, ts_ns=0)], [entry], tmp_path)
    assert table.row(0, named=True) == {
        "frame.time": table["frame.time"][0], "frame.number": 1, "ip.src": "10.0.0.1", "nv.subindex": 0,
        "var.ip.src": 5, "x": 1, "x.name": "eRun", "var.x.name": 6,
    }  # fmt: skip


def test_files_of_lists_have_safe_names_of_their_own() -> None:
    names = ["axis", "Axis", "../up", "a b", ""]
    lists = [(ListKey.udp(1202, number), ListDefinition(name, HERE, ())) for number, name in enumerate(names)]
    assert paths_of("dir/out.csv", lists[:1]) == ["dir/out.csv"]
    assert paths_of("dir/out.csv", lists) == [
        "dir/out.axis.csv", "dir/out.Axis-1202-1.csv", "dir/out._up.csv", "dir/out.a_b.csv", "dir/out.list.csv",
    ]  # fmt: skip
    on_can = [ListKey.can("can0", 1), ListKey.can(ANY_CHANNEL, 2)]
    named = paths_of("out.csv", [*lists[:1], *((key, ListDefinition("AXIS", HERE, ())) for key in on_can)])
    assert named == ["out.axis.csv", "out.AXIS-can0-1.csv", "out.AXIS-can-2.csv"]


def test_a_union_is_bytes_and_nan_stays_nan(tmp_path: Path) -> None:
    assert isinstance(UNKNOWN, Union)
    entry = list_of([UNKNOWN, LREAL])
    (table,) = wide([telegram(b"abcd" + b"\xff" * 8, 2, subindex=0, counter=0, ts_ns=0)], [entry], tmp_path)
    assert table["v0"].to_list() == [b"abcd"]
    assert isnan(table["v1"][0])


POINTER, MISSING = SCALARS["POINTER"], unknown_raw("ST_MISSING")


def known_of(entry: ListDefinition, frame: Frame) -> dict[str, Any]:
    """Return what is known of a telegram: its variables, up to the first of unknown size, and the bytes from there."""
    payload = frame.data[42:]
    items, length = (int.from_bytes(payload[at : at + 2], "little") for at in (12, 14))
    layout = known_part(pack(entry), int.from_bytes(payload[10:12], "little"), items, length - 20)
    assert layout
    return {
        element.name: value_of(element.type, payload[20 + at : 20 + at + element.type.size_bytes])
        for at, element in layout.spans()
    }


@examples(40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.sampled_from([INT, LREAL, String(130), POINTER, MISSING]), max_size=5), st.booleans(),
    st.lists(st.tuples(st.integers(0, 6), st.integers(0, 40), st.integers(0, 255)), min_size=1, max_size=20),
    st.integers(1, 8),
)  # fmt: skip
def test_of_unknown_sizes_both_forms_hold_what_is_known(
    tmp_path: Path, types: list[Type], packed: bool, seeds: list[tuple[int, int, int]], batch_frames: int
) -> None:
    entry = list_of([*types, POINTER, INT], pack=packed)
    fronts = known_fronts(pack(entry))
    frames = []
    for number, (subindex, more, byte) in enumerate(seeds):
        known = fronts.of(subindex)
        assume(known)
        front, cause = known
        size = front.layout.size_bytes + (more if cause else 0)
        frames.append(
            telegram(
                bytes([byte]) * size, front.items + bool(cause), subindex=subindex, counter=number, ts_ns=number * 10**9
            )
        )
    (table,) = wide(frames, [entry], tmp_path, batch_frames)
    below = long(frames, [entry], tmp_path, batch_frames).rows(named=True)
    assert table["nv.subindex"].to_list() == [subindex for subindex, _, _ in seeds]
    for row, frame in zip(table.rows(named=True), frames, strict=True):
        expected = known_of(entry, frame)
        told = {name: value for name, value in row.items() if name.startswith("v") and value not in (None, b"")}
        assert told.keys() == expected.keys()
        assert all(equal(told[name], value) for name, value in expected.items())
        while below and below[0]["frame.number"] == row["frame.number"]:
            one = below.pop(0)
            value = next((one[kind] for kind in ("integer", "real", "text", "bytes") if one[kind] is not None), None)
            assert one["nv.subindex"] == row["nv.subindex"]
            assert equal(value, expected.pop(one["variable"], b""))
        assert not expected
    assert not below


def test_several_definitions_share_the_columns_of_equal_variables(tmp_path: Path) -> None:
    first, second = list_of([INT, STATE, INT, TIME]), list_of([INT, STATE, LREAL, SCALARS["LTIME"], INT])
    third = list_of([INT, INT])
    frames = [
        telegram(struct.pack("<hhhI", 1, 1, 2, 3), 4, subindex=0, counter=0, ts_ns=0),
        telegram(struct.pack("<hhdQh", 4, -1, 5.5, 6, 7), 5, subindex=0, counter=1, ts_ns=1),
        telegram(struct.pack("<hh", 8, 9), 2, subindex=0, counter=2, ts_ns=2),
        telegram(struct.pack("<h", 8), 1, subindex=0, counter=3, ts_ns=3),
    ]
    telegrams, rows = telegrams_of(frames, [first, second, third])
    table, beyond = wide_frame(telegrams, rows)
    assert table.columns[4:] == ["v0", "v1", "v1.name", "v2", "v3", "v2 : LREAL", "v4", "v1 : INT"]
    assert beyond == 0
    assert [[None if one is None else str(one) for one in row[4:]] for row in table.rows()] == [
        ["1", "1", "eRun", "2", "0:00:00.003000", None, None, None],
        ["4", "-1", "eFault", None, "0:00:00", "5.5", "7", None],
        ["8", None, None, None, None, None, None, "9"],
    ]
    assert telegrams.left_out == {ListKey.udp(1202, 7): {LeftOut.UNFITTING: 1}}


def test_a_list_of_which_nothing_can_be_looked_for(tmp_path: Path) -> None:
    from tests.records import replace  # noqa: PLC0415

    with pytest.raises(UsageError, match="of none does a file say a list identifier"):
        lists_to_write(Layouts(Definition((replace(list_of([INT]), list_id=None),))))
    entry = list_of([INT, POINTER])
    assert lists_to_write(Layouts(Definition((entry,))), ["test"]) == [(ListKey.udp(1202, 7), entry)]
