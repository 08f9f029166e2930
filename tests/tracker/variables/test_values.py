"""Values in bulk against a decoder that takes one telegram and one element after the other."""

from __future__ import annotations

import math
import random
import struct
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import pack
from nvscope.definition.value import value_of
from nvscope.definition.variables import Enumeration, Scalar, ScalarKind, String, Type
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import MOST_LAYOUTS, Values
from nvscope.view.documents.variables import variables_document
from nvscope.view.value_texts import json_value
from tests.definition.lists import BOOL, INT, LREAL, REAL, STATE, TIME, UDINT, UNKNOWN, VARIABLES, list_of, telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of, observed, recorded
from tests.packets import cut as cut_into

POINTER = Scalar("POINTER", ScalarKind.RAW, "V0", 0)
START_NS = 1_700_000_000_000_000_000


def random_bytes(choice: random.Random, kind: Any, before: bytes | None) -> bytes:
    """Return bytes of an element, often those of before, sometimes strings with leftovers behind their end."""
    if before is not None and choice.random() < 0.5:
        return before
    raw = bytearray(choice.choice([0, 0, 1, 65, 66, 255, choice.randrange(256)]) for _ in range(kind.size_bytes))
    return bytes(raw)


def telegrams_of(definition: ListDefinition, seed: int, count: int) -> list[tuple[Frame, int, list[bytes]]]:
    """Return frames of a list with their SubIndex and the bytes of their elements."""
    choice = random.Random(seed)
    layouts = pack(definition)
    before: dict[tuple[int, int], bytes] = {}
    sent = []
    for number in range(count):
        layout = choice.choice(layouts)
        parts = []
        for place, element in enumerate(layout.elements):
            key = layout.subindex, place
            before[key] = random_bytes(choice, element.type, before.get(key))
            parts.append(before[key])
        frame = telegram(
            b"".join(parts), layout.items, subindex=layout.subindex, counter=number, ts_ns=START_NS + number * 1_000_000
        )
        sent.append((frame, layout.subindex, parts))
    return sent


def seen(kind: Any, raw: bytes) -> bytes:
    """Return what of an element's bytes counts: of strings, what stands before the end, of a BOOL, whether it is 0.

    There is one zero and one NaN.
    """
    if kind is BOOL:
        return bytes([any(raw)])
    if kind in (REAL, LREAL):
        number = struct.unpack("<f" if kind is REAL else "<d", raw)[0]
        return b"NaN" if math.isnan(number) else raw if number else b"0"
    if not isinstance(kind, String):
        return raw
    step = 2 if kind.wide else 1
    units = [raw[at : at + step] for at in range(0, len(raw), step)]
    end = units.index(bytes(step)) if bytes(step) in units else len(units)
    return b"".join(units[:end])


def has_order(kind: Any) -> bool:
    scalar = kind.base if isinstance(kind, Enumeration) else kind
    return isinstance(scalar, Scalar) and scalar.kind is not ScalarKind.RAW


@given(VARIABLES, st.booleans(), st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 40))
def test_bulk_values_are_those_of_one_telegram_after_the_other(
    types: list[Type], packed: bool, seed: int, count: int, cut: int
) -> None:
    definition = list_of(types, pack=packed)
    sent = telegrams_of(definition, seed, count)
    values = Values(Layouts(Definition((definition,))))
    state = TrackerState(values=values)
    whole = batch_of([frame for frame, _, _ in sent])
    observed(state, cut_into(whole, cut))

    rows = {(row["subindex"], row["name"]): row for row in variables_document(state, values)["variables"]}
    for layout in pack(definition):
        own = [(frame, parts) for frame, subindex, parts in sent if subindex == layout.subindex]
        for place, element in enumerate(layout.elements):
            if not own:
                assert (layout.subindex, element.name) not in rows
                continue
            row, kind = rows[layout.subindex, element.name], element.type
            raws = [seen(kind, parts[place]) for _, parts in own]
            changed = [number for number in range(1, len(raws)) if raws[number] != raws[number - 1]]
            assert (row["telegrams"], row["changes"]) == (len(own), len(changed))
            assert row["changed_ns"] == str(own[changed[-1] if changed else 0][0].ts_ns)
            assert row["last_ns"] == str(own[-1][0].ts_ns)
            found = [value_of(kind, parts[place]) for _, parts in own]
            last = found[-1]
            if isinstance(last, bytes):
                assert row["value"] == last.hex()
            else:
                assert row["value"] == json_value(kind, last)
            numbers = [number for number in found if isinstance(number, int | float) and not math.isnan(number)]
            if has_order(kind) and kind is not BOOL and numbers and all(map(math.isfinite, numbers)):
                assert (row["min"], row["max"]) == (json_value(kind, min(numbers)), json_value(kind, max(numbers)))


@given(VARIABLES, st.lists(st.integers(0, 10_000), min_size=2, max_size=4), st.integers(1, 40))
def test_changes_of_recordings_are_those_of_each(types: list[Type], seeds: list[int], cut: int) -> None:
    """Another value behind a time in which nobody listened is no change: nobody knows how many there were, and when."""
    definition = list_of(types, pack=False)
    recordings = [
        cut_into(batch_of([frame for frame, _, _ in telegrams_of(definition, seed, 20)]), cut) for seed in seeds
    ]

    def rows_of(batches: list[PacketBatch]) -> dict[tuple[int, str], dict[str, Any]]:
        values = Values(Layouts(Definition((definition,))))
        state = observed(TrackerState(values=values), batches)
        return {(row["subindex"], row["name"]): row for row in variables_document(state, values)["variables"]}

    alone = [rows_of(batches) for batches in recordings]
    for place, row in rows_of(recorded(*recordings)).items():
        known = [own[place] for own in alone if place in own]
        changed = [one for one in known if one["changes"]]
        assert row["changes"] == sum(one["changes"] for one in known)
        assert row["changed_ns"] == (changed[-1] if changed else known[0])["changed_ns"]
        assert row["text"] == known[-1]["text"]


def test_what_does_not_fit_is_counted_and_not_decoded() -> None:
    definition = list_of([INT, REAL])
    values = Values(Layouts(Definition((definition,))))
    state = TrackerState(values=values)
    frames = [
        telegram(b"\1\0\0\0\0\0", 2, subindex=0, counter=1, ts_ns=START_NS),
        telegram(b"\2\0\0\0\0\0\0", 2, subindex=0, counter=2, ts_ns=START_NS + 1),
        telegram(b"\3\0\0\0\0\0", 3, subindex=0, counter=3, ts_ns=START_NS + 2),
        telegram(b"\4\0", 1, subindex=1, counter=1, ts_ns=START_NS + 3),
    ]
    observed(state, [batch_of(frames)])
    first, _ = variables_document(state, values)["variables"]
    assert (first["value"], first["telegrams"]) == (1, 1)
    assert values.unfitting.column("count").tolist() == [2, 1]
    assert values.unfitting.frames[0, :3].tolist() == [2, 3, 0]


def test_equal_values_are_no_change() -> None:
    definition = list_of([REAL, LREAL, REAL, REAL, BOOL])
    values = Values(Layouts(Definition((definition,))))
    state = TrackerState(values=values)
    quiet, signalling = b"\0\0\xc0\x7f", b"\1\0\xa0\xff"
    frames = [
        telegram(zero + bytes(7) + sign + nan + number + truth, 5, subindex=0, counter=count, ts_ns=START_NS + count)
        for count, (zero, sign, nan, number, truth) in enumerate(
            [
                (b"\0\0\0\x80", b"\x80", quiet, b"\0\0\x80\x3f", b"\1"),
                (b"\0\0\0\0", b"\0", signalling, b"\0\0\x80\xbf", b"\2"),
                (b"\0\0\0\x80", b"\x80", quiet, b"\0\0\x80\xbf", b"\3"),
            ]
        )
    ]
    observed(state, [batch_of(frames)])
    rows = variables_document(state, values)["variables"]
    assert [row["changes"] for row in rows] == [0, 0, 0, 1, 0]
    assert (rows[3]["min"], rows[3]["max"]) == (-1.0, 1.0)


@given(st.lists(st.sampled_from("AABC"), min_size=1, max_size=40), st.integers(1, 40))
def test_a_sender_whose_program_is_changed_is_read_with_the_definition_that_fits(sent: list[str], cut: int) -> None:
    definitions = {"A": list_of([INT, INT]), "B": list_of([INT, UDINT])}
    layouts = Layouts(Definition(tuple(definitions.values())))
    sizes = {"A": (4, 2), "B": (6, 2), "C": (7, 2)}
    frames = [
        telegram(bytes([number] * sizes[kind][0]), sizes[kind][1], subindex=0, counter=number, ts_ns=START_NS + number)
        for number, kind in enumerate(sent)
    ]
    values = Values(layouts)
    state = TrackerState(values=values)
    whole = batch_of(frames)
    observed(state, cut_into(whole, cut))

    def last(kind: str) -> int:
        return max((number for number, one in enumerate(sent) if one == kind), default=-1)

    expected = sorted((kind for kind in "AB" if kind in sent), key=last)
    document = variables_document(state, values)
    shown = [*document["earlier"], *document["variables"]]
    assert [row["type"] for row in shown if row["name"] == "v1"] == [
        {"A": "INT", "B": "UDINT"}[kind] for kind in expected
    ]
    for kind, rows in zip(expected, zip(shown[::2], shown[1::2], strict=True), strict=True):
        assert {row["telegrams"] for row in rows} == {sent.count(kind)}
        assert {row["changes"] for row in rows} == {sent.count(kind) - 1}
        assert {row["last_ns"] for row in rows} == {str(START_NS + last(kind))}
        assert rows[0]["value"] == last(kind) * 257
    if not expected:
        assert not shown
        return
    fitted = values.fitted(0)
    assert [(entry.telegrams, entry.frames[0], entry.last_frame) for entry in fitted] == [
        (sent.count(kind), sent.index(kind) + 1, last(kind) + 1) for kind in expected
    ]
    assert values.unfitting.column("count").tolist() == [sent.count("C")]


def test_of_a_list_that_is_partly_known_each_shape_has_its_bytes_up_to_a_limit() -> None:
    definition = list_of([INT, POINTER, INT])
    values = Values(Layouts(Definition((definition,))))
    state = TrackerState(values=values)
    sizes = [*range(2, 40), 2]
    frames = [
        telegram(bytes([size] * size), 3, subindex=0, counter=number, ts_ns=START_NS + number)
        for number, size in enumerate(sizes)
    ]
    observed(state, [batch_of(frames)])
    document = variables_document(state, values)
    assert [(row["name"], row["value"], row["telegrams"]) for row in document["variables"]] == [("v0", 514, 2)]
    assert len({row["last_ns"] for row in document["earlier"]}) == MOST_LAYOUTS - 1
    assert values.unfitting.column("count").tolist() == [len(set(sizes)) - MOST_LAYOUTS]


def test_texts_are_what_an_engineer_writes() -> None:
    definition = list_of([BOOL, STATE, STATE, TIME, String(4), UNKNOWN, REAL, UDINT])
    data = (
        b"\1"
        + b"\1\0"
        + b"\7\0"
        + (90_500).to_bytes(4, "little")
        + b"ab\0cd"
        + b"\1\2\3\4"
        + b"\0\0\x48\x41"
        + b"\7\0\0\0"
    )
    values = Values(Layouts(Definition((definition,))))
    state = TrackerState(values=values)
    observed(state, [batch_of([telegram(data, 8, subindex=0, counter=1, ts_ns=START_NS)])])
    assert [row["text"] for row in variables_document(state, values)["variables"]] == [
        "TRUE", "eRun (1)", "7 (no value of eState)", "T#1m30s500ms", "'ab'", "01 02 03 04", "12.5", "7",
    ]  # fmt: skip
