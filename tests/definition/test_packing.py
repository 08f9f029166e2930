"""Where the elements of a list lie: by examples from the documents, and by laws."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition.packing import PACKED_DATA_BYTES, pack
from nvscope.definition.variables import Array, Member, String, Structure, Type, elements, size_bytes_of
from nvscope.errors import ConfigurationError
from tests.definition.lists import BOOL, BYTE, INT, LREAL, REAL, UDINT, VARIABLES, list_of
from tests.records import replace

AXIS = Structure("Axis", (Member("pos", LREAL), Member("vel", REAL)))


def test_names_offsets_and_header_of_a_packed_list() -> None:
    (layout,) = pack(list_of([BOOL, AXIS, Array(((0, 1), (1, 2)), INT), String(3)]))
    assert [(offset, element.name) for offset, element in layout.spans()] == [
        (0, "v0"), (1, "v1.pos"), (9, "v1.vel"),
        (13, "v2[0, 1]"), (15, "v2[0, 2]"), (17, "v2[1, 1]"), (19, "v2[1, 2]"), (21, "v3"),
    ]  # fmt: skip
    assert (layout.items, layout.length) == (8, 20 + 25)


def test_an_element_that_does_not_fit_opens_the_next_telegram() -> None:
    layouts = pack(list_of([Array(((1, 63),), UDINT), AXIS, BOOL]))
    assert [(layout.subindex, layout.items, layout.length) for layout in layouts] == [(0, 63, 272), (1, 3, 33)]


def test_what_still_fits_is_not_pulled_forward() -> None:
    layouts = pack(list_of([Array(((1, 255),), BYTE), INT, BOOL]))
    assert [layout.items for layout in layouts] == [255, 2]


def test_a_long_string_travels_alone() -> None:
    layouts = pack(list_of([BOOL, String(300), BOOL]))
    assert [layout.length for layout in layouts] == [21, 321, 21]


def test_unpacked_lists_have_a_telegram_an_element() -> None:
    layouts = pack(list_of([AXIS, Array(((5, 6),), BOOL)], pack=False))
    assert [(layout.subindex, layout.elements[0].name, layout.items) for layout in layouts] == [
        (0, "v0.pos", 1), (1, "v0.vel", 1), (2, "v1[5]", 1), (3, "v1[6]", 1),
    ]  # fmt: skip


def test_too_many_elements_are_refused_with_the_variable() -> None:
    with pytest.raises(ConfigurationError) as error:
        pack(list_of([Array(((0, 10**9),), BOOL)]))
    assert "test.gvl, line 1" in error.value.where
    with pytest.raises(ConfigurationError):
        pack(list_of([Array(((0, 65_536),), BOOL)], pack=False))


@given(VARIABLES, st.booleans())
def test_every_element_is_sent_once_in_order_and_whole(types: list[Type], packed: bool) -> None:
    definition = list_of(types, pack=packed)
    layouts = pack(definition)
    sent = [element.name for layout in layouts for element in layout.elements]
    assert sent == [element.name for variable in definition.variables for element in elements(variable)]
    assert sum(layout.length - 20 for layout in layouts) == sum(size_bytes_of(kind) for kind in types)
    for layout, following in pairwise(layouts):
        assert layout.items == 1 or layout.length - 20 <= PACKED_DATA_BYTES
        if packed:
            assert layout.length - 20 + following.elements[0].type.size_bytes > PACKED_DATA_BYTES


def test_a_list_on_can_is_packed_into_frames_of_8_bytes() -> None:
    layouts = pack(replace(list_of([UDINT, INT, INT, BOOL, LREAL, BOOL]), protocol="can"))
    assert [layout.layout.size_bytes for layout in layouts] == [8, 1, 8, 1]
