"""The variables of lists as a WebVisu has them: names, places, and the values that came last."""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence
from itertools import pairwise
from math import isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import STRING, TYPES, Place
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import pack
from nvscope.definition.scalars import SCALARS
from nvscope.definition.value import value_of
from nvscope.definition.variables import Elementary, Enumeration, Scalar, ScalarKind, String, Variable, scalar_of
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.plc.visu.element import element_text, visu_type
from nvscope.plc.visu.lists import ServedLists
from nvscope.plc.visu.table import MOST_VARIABLES
from nvscope.plc.visu.value import shown
from nvscope.view.value_texts import json_value
from tests.definition.lists import (
    BOOL,
    BYTE,
    HERE,
    INT,
    LINT,
    REAL,
    STATE,
    UDINT,
    UNKNOWN,
    VARIABLES,
    list_of,
    telegram,
)
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import Batches, batch_of, cut
from tests.records import replace
from tests.tracker.variables.test_values import telegrams_of


def served(*lists: ListDefinition) -> ServedLists:
    return ServedLists(Layouts(Definition(lists)))


def seen(lists: ServedLists, frames: Sequence[Frame], size: int = 100) -> ServedLists:
    """Have lists seen these frames, in batches of so many."""
    for _ in run(Batches(cut(batch_of(frames), size)), Reading(), [lists]):
        pass
    return lists


def values(lists: ServedLists) -> dict[str, str | None]:
    return {one.name: lists.now(one.place) for one in lists.table.entries}


def sent(data: bytes, items: int, number: int = 0, *, list_id: int = 7, subindex: int = 0) -> Frame:
    return telegram(data, items, subindex=subindex, counter=number, ts_ns=number * 1_000_000, list_id=list_id)


@given(VARIABLES, st.booleans(), st.integers(0, 10_000), st.integers(0, 20), st.integers(1, 9))
@examples(60)
def test_a_value_is_that_of_the_last_telegram_that_has_it(
    types: list[object], packed: bool, seed: int, count: int, size: int
) -> None:
    definition = list_of(types, pack=packed)  # type: ignore[arg-type]
    frames = telegrams_of(definition, seed, count)
    last = {subindex: parts for _, subindex, parts in frames}
    expected = {
        element.name: element_text(element.type, last[layout.subindex][place]) if layout.subindex in last else None
        for layout in pack(definition)
        for place, element in enumerate(layout.elements)
    }
    assert values(seen(served(definition), [frame for frame, _, _ in frames], size)) == expected


KINDS: list[Elementary] = [
    *(kind for kind in SCALARS.values() if kind.size_bytes), STATE, Enumeration("eWide", LINT, {}),
    Enumeration("eByte", BYTE, {}), UNKNOWN, String(5), String(5, wide=True), String(0),
]  # fmt: skip


@given(st.sampled_from(KINDS), st.integers(0, 1 << 64))
@examples()
def test_what_a_client_reads_is_what_the_list_has(kind: Elementary, seed: int) -> None:
    raw = random.Random(seed).randbytes(kind.size_bytes)
    size, code = visu_type(kind)
    place, text, value = Place(4, 0, size, code), element_text(kind, raw), value_of(kind, raw)
    if isinstance(value, float) and not isfinite(value):
        assert text is None
        return
    assert text is not None
    text.encode("iso-8859-1")
    if code == STRING:
        # With its terminating NUL, it fits; a list may send a text without one.
        assert len(text) < size + (isinstance(kind, String) and 0 not in raw)
        if isinstance(kind, String):
            expected = str(value) if not kind.wide else str(value).encode("iso-8859-1", "replace").decode("iso-8859-1")
            assert shown(place, text).value == expected
        return
    read = shown(place, text).value
    scalar = scalar_of(kind)
    assert isinstance(scalar, Scalar)
    if scalar.kind is ScalarKind.REAL and scalar.size_bytes == 4:
        assert isinstance(read, float | int)
        assert struct.pack("<f", read) == raw or not any(raw[:3])  # -0.0 is 0.0
    else:
        assert read == json_value(kind, value)


def test_types_are_those_of_v23_and_what_it_has_not_is_a_text() -> None:
    told = {
        kind.name: (TYPES[visu_type(kind).code], visu_type(kind).size)
        for kind in (
            *(SCALARS[name] for name in ("BOOL", "LREAL", "TOD", "LWORD", "LTIME")),
            STATE,
            UNKNOWN,
            *KINDS[-3:],
        )
    }
    assert told == {
        "BOOL": ("BOOL", 1), "LREAL": ("LREAL", 8), "TOD": ("TOD", 4), "LWORD": ("STRING", 81),
        "LTIME": ("STRING", 81), "eState": ("ENUM", 2), "uAny": ("STRING", 81), "STRING(5)": ("STRING", 6),
        "WSTRING(5)": ("STRING", 6), "STRING(0)": ("STRING", 1),
    }  # fmt: skip
    assert (element_text(LINT, b"\xff" * 8), element_text(SCALARS["LTIME"], b"\x01" + bytes(7))) == ("-1", "LTIME#1ns")
    assert element_text(String(3, wide=True), "aä€".encode("utf-16-le") + bytes(2)) == "aä?"


def test_each_variable_has_a_place_of_its_own_behind_the_one_before() -> None:
    lists = served(list_of([BOOL, String(3), INT]), replace(list_of([REAL, UDINT], list_id=8), name="other"))
    assert [(one.name, one.place.text) for one in lists.table.entries] == [
        ("test.v0", "4,0,1,0"), ("test.v1", "4,1,4,8"), ("v2", "4,5,2,1"), ("other.v0", "4,7,4,6"),
        ("other.v1", "4,11,4,17"),
    ]  # fmt: skip
    for one, behind in pairwise(entry.place for entry in lists.table.entries):
        assert one.offset + one.size == behind.offset
    assert lists.lists == 2
    assert lists.now(Place(4, 99, 2, 1)) is None


def test_variables_of_one_name_are_told_apart_by_list_and_then_by_key() -> None:
    one, other = list_of([INT]), list_of([INT], list_id=8)
    third = replace(other, name="My list", list_id=9)
    lists = seen(
        served(one, other, third), [sent(b"\1\0", 1), sent(b"\2\0", 1, list_id=8), sent(b"\3\0", 1, list_id=9)]
    )
    assert values(lists) == {"udp_1202_7.v0": "1", "udp_1202_8.v0": "2", "My_list.v0": "3"}


def test_another_program_that_sends_the_list_is_read_by_its_own_definition() -> None:
    """v0 moves to another place, and v1 is of another type there, which no value of it can be."""
    before = list_of([INT, INT])
    after = replace(before, variables=tuple(Variable(name, kind, HERE) for name, kind in (("V1", REAL), ("v0", INT))))
    lists = served(before, after)
    assert [one.name for one in lists.table.entries] == ["v0", "v1"]
    first, second = sent(struct.pack("<hh", 1, 2), 2), sent(struct.pack("<fh", 0.5, 3), 2, 1)
    assert values(seen(lists, [first])) == {"v0": "1", "v1": "2"}
    assert values(seen(served(before, after), [first, second])) == {"v0": "3", "v1": None}


def test_what_is_known_of_a_list_in_part_has_values() -> None:
    pointer = Scalar("POINTER", ScalarKind.RAW, "V0", 0)
    lists = served(list_of([INT, pointer, INT]))
    assert [one.name for one in lists.table.entries] == ["v0"]
    assert values(seen(lists, [sent(b"\5\0" + bytes(6), 3)])) == {"v0": "5"}


def test_telegrams_of_another_shape_change_nothing() -> None:
    frames = [sent(b"\1\0", 1), sent(b"\2\0\0", 1, 1), sent(b"\3\0", 2, 2), sent(b"\4\0", 1, 3, list_id=9)]
    frames.append(sent(b"\5\0", 1, 4, subindex=1))
    assert values(seen(served(list_of([INT])), frames)) == {"v0": "1"}


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_of_several_senders_the_last_one_counts(order: tuple[int, int]) -> None:
    frames = [sent(b"\1\0", 1), sent(b"\2\0", 1, 1)]
    frames[1] = frames[1]._replace(data=frames[1].data.replace(b"\x0a\0\0\1", b"\x0a\0\0\2"))
    lists = seen(served(list_of([INT])), [frames[place] for place in order])
    assert values(lists) == {"v0": str(order[1] + 1)}


def test_more_variables_than_are_served_are_counted() -> None:
    lists = served(list_of([BOOL] * MOST_VARIABLES), replace(list_of([BOOL, BOOL], list_id=8), name="b"))
    assert (len(lists.table.entries), lists.left_out) == (MOST_VARIABLES, 2)


def test_the_list_of_variables_has_another_time_where_something_lies_elsewhere() -> None:
    stamps = [served(list_of(types)).table.stamp for types in ([INT, BOOL], [INT, BOOL], [BOOL, INT], [INT])]
    assert stamps[0] == stamps[1]
    assert len(set(stamps)) == 3
