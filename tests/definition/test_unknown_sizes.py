"""Lists with elements whose size nobody knows: what stands in front of them is decoded, the rest are bytes."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest

from nvscope.definition.difference import list_difference
from nvscope.definition.layouts import Layouts
from nvscope.definition.lint import lint
from nvscope.definition.load import load_definitions
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.pdos import frames_of
from nvscope.definition.scalars import SCALARS, unknown_raw
from nvscope.definition.variables import Array, Type, Variable
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values
from nvscope.view.documents.layout import layout_document
from nvscope.view.documents.variables import variables_document
from tests.definition.lists import INT, REAL, UNKNOWN, list_of, telegram
from tests.packets import batch_of, observed
from tests.records import replace
from tests.tracker.variables.test_values import START_NS

POINTER = SCALARS["POINTER"]


def shown(definition: ListDefinition, *telegrams: tuple[int, int, bytes]) -> list[tuple[str, str, str]]:
    """Return name, type and value of what is shown after some telegrams (SubIndex, Items, data)."""
    values = Values(Layouts(Definition((definition,))))
    state = TrackerState(values=values)
    frames = [
        telegram(data, items, subindex=subindex, counter=1, ts_ns=START_NS + number)
        for number, (subindex, items, data) in enumerate(telegrams)
    ]
    observed(state, [batch_of(frames)])
    return [(row["name"], row["type"], row["text"]) for row in variables_document(state, values)["variables"]]


@pytest.mark.parametrize("pointer_bytes", [4, 8])
def test_what_stands_behind_a_pointer_is_bytes_whatever_its_size(pointer_bytes: int) -> None:
    types: list[Type] = [INT, POINTER, REAL]
    data = struct.pack("<h", -5) + bytes(pointer_bytes) + struct.pack("<f", 1.0)
    assert shown(list_of(types), (0, 3, data)) == [
        ("v0", "INT", "-5"),
        ("v1 …", "bytes from v1 : POINTER on", data[2:].hex(" ")),
    ]


def test_unpacked_only_the_element_itself_is_bytes() -> None:
    definition = list_of([INT, POINTER, REAL], pack=False)
    assert shown(definition, (0, 1, b"\7\0"), (1, 1, b"\1\2"), (2, 1, struct.pack("<f", 2.5))) == [
        ("v0", "INT", "7"),
        ("v1 …", "bytes from v1 : POINTER on", "01 02"),
        ("v2", "REAL", "2.5"),
    ]
    # It is one telegram, so that the list has three.
    assert shown(definition, (3, 1, b"\1\2")) == []


# A BIT may share its byte with others.
@pytest.mark.parametrize("kind", [unknown_raw("ST_MISSING"), SCALARS["BIT"], Array(((0, 1),), unknown_raw("FB_DRIVE"))])
def test_unpacked_nothing_has_a_name_behind_what_may_be_any_number_of_telegrams(kind: Type) -> None:
    definition = list_of([INT, POINTER, kind, REAL], pack=False)
    data = struct.pack("<f", 2.5)
    told = shown(definition, (0, 1, b"\7\0"), (1, 1, b"\1\2"), (2, 1, data), (3, 1, data), (9, 1, data))
    first = "v2[0] …" if isinstance(kind, Array) else "v2 …"
    assert [name for name, _, _ in told] == ["v0", "v1 …", first, first, first]


def test_telegrams_behind_the_one_with_the_pointer_are_bytes() -> None:
    found = shown(list_of([INT, POINTER, REAL]), (1, 1, b"\1\2\3"))
    assert found == [("v1 …", "bytes from v1 : POINTER on", "01 02 03")]


def test_a_telegram_too_short_for_what_is_known_is_not_decoded() -> None:
    assert shown(list_of([INT, INT, POINTER]), (0, 3, b"\1\0\2")) == []
    assert shown(list_of([INT, INT, POINTER]), (0, 1, b"\1\0\2\0\3")) == []


def test_of_a_union_the_bytes_are_shown_and_that_it_is_one() -> None:
    definition = list_of([INT, UNKNOWN, INT])
    assert shown(definition, (0, 3, b"\1\0\1\2\3\4\2\0")) == [
        ("v0", "INT", "1"),
        ("v1", "UNION uAny", "01 02 03 04"),
        ("v2", "INT", "2"),
    ]


def layout_of(definition: ListDefinition) -> list[tuple[int | None, int | None, int | None, list[tuple[str, Any]]]]:
    """Return SubIndex, Items and Length of each telegram of a byte map, and names with offsets of its elements."""
    (entry,) = layout_document(Definition((definition,)))["lists"]
    return [
        (
            telegram["subindex"], telegram["items"], telegram["length"],
            [(element["name"], element["offset"]) for element in telegram["elements"]],
        )
        for telegram in entry["telegrams"]
    ]  # fmt: skip


def test_a_byte_map_invents_no_telegrams_behind_what_is_of_unknown_size() -> None:
    long = Array(((0, 299),), SCALARS["BYTE"])
    definition = list_of([SCALARS["BYTE"], POINTER, long, SCALARS["DINT"]])
    front, behind = layout_of(definition)
    # Whether the pointer, and more, still lies in the first telegram, nobody knows.
    assert front == (0, None, None, [("v0", 0)])
    assert behind[:3] == (None, None, None)
    assert [name for name, _ in behind[3]] == ["v1", *(f"v2[{place}]" for place in range(300)), "v3"]
    assert {offset for _, offset in behind[3]} == {None}
    # Of what has no place, nobody knows whether it is cut between telegrams.
    mistakes = lint([], Definition((definition,)))
    assert [each.rule.id for each in mistakes] == ["unknown-size"]


def test_telegrams_in_front_of_what_is_of_unknown_size_are_whole() -> None:
    full = Array(((0, 127),), INT)
    whole, front, behind = layout_of(list_of([full, INT, POINTER, INT]))
    assert whole[:3] == (0, 128, 20 + 256)
    assert front == (1, None, None, [("v1", 0)])
    assert [name for name, _ in behind[3]] == ["v2", "v3"]
    assert [each[0] for each in layout_of(list_of([POINTER, INT]))] == [None]


def test_unpacked_only_the_element_itself_has_no_length() -> None:
    assert layout_of(list_of([INT, POINTER, REAL], pack=False)) == [
        (0, 1, 22, [("v0", 0)]), (1, 1, None, [("v1", 0)]), (2, 1, 24, [("v2", 0)]),
    ]  # fmt: skip


MISSING = unknown_raw("ST_MISSING")


def test_unpacked_no_subindex_is_known_behind_what_may_be_any_number_of_telegrams() -> None:
    definition = list_of([INT, POINTER, MISSING, REAL], pack=False)
    assert layout_of(definition) == [
        (0, 1, 22, [("v0", 0)]), (1, 1, None, [("v1", 0)]), (None, None, None, [("v2", None), ("v3", None)]),
    ]  # fmt: skip
    assert layout_of(list_of([MISSING, REAL], pack=False))[0][0] is None


@pytest.mark.parametrize("kind", [POINTER, MISSING])
@pytest.mark.parametrize("pack", [True, False])
def test_a_byte_map_on_can_has_the_frames_that_are_looked_for(kind: Type, pack: bool) -> None:
    on_can = replace(list_of([Array(((0, 4),), INT), kind, REAL], pack=pack), protocol="CAN")
    front = [elements for subindex, _, _, elements in layout_of(on_can) if subindex is not None]
    looked_for = [[(each.name, offset) for offset, each in frame.spans()] for frame in frames_of(on_can)]
    assert front[: len(looked_for)] == looked_for
    # Of a packed list, what is in front of the unknown in one frame with it has offsets too.
    assert front[len(looked_for) :] == ([[("v0[4]", 0)]] if pack else [])


def test_unpacked_nothing_is_compared_behind_what_may_be_any_number_of_telegrams() -> None:
    unknown = list_of([INT, MISSING, REAL, INT], pack=False)
    known = list_of([INT, INT, INT, INT, INT], pack=False)
    for other in (unknown, known):
        for found in (list_difference(unknown, other), list_difference(other, unknown)):
            assert [(each.subindex, each.same) for each in found.telegrams] == [(0, True), (1, None)]
            assert found.same_on_wire is None
    # A pointer is one telegram: behind it, the lists do differ.
    pointer = list_of([INT, POINTER, REAL, INT], pack=False)
    found = list_difference(pointer, known)
    assert [each.same for each in found.telegrams] == [True, None, False, True, False]
    assert found.same_on_wire is False


def test_unpacked_arrays_are_cut_whatever_is_known_of_the_list() -> None:
    array = Variable("v1", Array(((0, 3),), INT), list_of([]).position)
    for first in (POINTER, MISSING):
        definition = list_of([first], pack=False)
        found = lint([], Definition((replace(definition, variables=(*definition.variables, array)),)))
        assert [each.rule.id for each in found] == ["unknown-size", "cut-variable"]


def test_texts_and_enumerations_are_one_telegram_whatever_is_not_known_of_them(tmp_path: Path) -> None:
    declared = "s : STRING(N); w : WSTRING(N); e : E_ANY; r : T_MISSING(0..3); x : __XWORD; v : PVOID; last : INT;"
    (tmp_path / "one.gvl").write_text(
        f"<GVL><Declarations>TYPE E_ANY : (a, b) T_MISSING; END_TYPE VAR_GLOBAL {declared} END_VAR</Declarations>"
        "<NetvarSettings Protocol='UDP'><ListIdentifier>5</ListIdentifier><Pack>False</Pack></NetvarSettings></GVL>"
    )
    (definition,) = load_definitions([str(tmp_path / "one.gvl")]).lists
    telegrams = layout_of(definition)
    assert [(subindex, length) for subindex, _, length, _ in telegrams] == [
        *((subindex, None) for subindex in range(6)), (6, 22),
    ]  # fmt: skip
