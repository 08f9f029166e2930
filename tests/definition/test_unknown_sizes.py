"""Lists with elements whose size nobody knows: what stands in front of them is decoded, the rest are bytes."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from nvscope.definition.layouts import Layouts
from nvscope.definition.lint import lint
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Array, Type
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values
from nvscope.view.documents.layout import layout_document
from nvscope.view.documents.variables import variables_document
from tests.definition.lists import INT, REAL, UNKNOWN, list_of, telegram
from tests.packets import batch_of, observed
from tests.tracker.variables.test_values import START_NS

POINTER, BIT = SCALARS["POINTER"], SCALARS["BIT"]


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
    definition = list_of([INT, BIT, REAL], pack=False)
    assert shown(definition, (0, 1, b"\7\0"), (1, 1, b"\1"), (2, 1, struct.pack("<f", 2.5))) == [
        ("v0", "INT", "7"),
        ("v1 …", "bytes from v1 : BIT on", "01"),
        ("v2", "REAL", "2.5"),
    ]


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
    assert layout_of(list_of([INT, BIT, REAL], pack=False)) == [
        (0, 1, 22, [("v0", 0)]), (1, 1, None, [("v1", 0)]), (2, 1, 24, [("v2", 0)]),
    ]  # fmt: skip
