"""Lists with elements whose size nobody knows: what stands in front of them is decoded, the rest are bytes."""

from __future__ import annotations

import struct

import pytest

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Type
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values
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
