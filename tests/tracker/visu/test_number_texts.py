"""Numbers in texts: read by whole columns as one by one, and as the rules say."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.webvisu import Place
from nvscope.definition.visu_values import type_at, value_in
from nvscope.tracker.readings.form import Form
from nvscope.tracker.visu.number_texts import Kinds, forms_and_bits
from tests.laws import examples
from tests.oracle.rules.visu_values import value_of

PLACES = st.tuples(
    st.just(4), st.just(0), st.sampled_from((0, 1, 2, 4, 8, 21)), st.integers(0, 25)
)  # fmt: skip
FIT = st.sampled_from(
    [(4, 0, size, kind) for size, kind in (
        (0, 0), (1, 0), (2, 1), (1, 2), (2, 3), (4, 4), (4, 5), (4, 6), (4, 7), (21, 8), (2, 10), (1, 12), (1, 14),
        (1, 15), (2, 16), (4, 17), (4, 18), (4, 19), (4, 20), (8, 22),
    )]
)  # fmt: skip
TEXTS = st.one_of(
    st.integers(-(2**34), 2**34).map(str),
    st.sampled_from(("0", "1", "01", "-0", "-1", "255", "-128", "65535", "+5", " 7", "7 ", "", "-", ".", "1.", ".5")),
    st.floats(allow_nan=True).map(repr),
    st.decimals(allow_nan=False, allow_infinity=False, places=6, min_value=-(10**9), max_value=10**9).map(str),
    st.text("0123456789+-.eE ", max_size=24),
    st.text(st.characters(max_codepoint=255), max_size=6),
)  # fmt: skip


def number_of(form: int, bits: int, place: tuple[int, int, int, int]) -> Any:
    """Return the number that 64 bits are, None of what is none."""
    if form == Form.REAL:
        return struct.unpack("<d", struct.pack("<Q", bits))[0]
    if form != Form.WHOLE:
        return None
    return struct.unpack("<q", struct.pack("<Q", bits))[0]


@examples(150)
@given(st.lists(st.tuples(FIT | PLACES, TEXTS), min_size=1, max_size=30))
def test_columns_of_texts_are_read_as_the_rules_say(drawn: list[tuple[tuple[int, int, int, int], str]]) -> None:
    kinds, stop = Kinds(), np.cumsum([len(text) for _, text in drawn])
    for place, _ in drawn:
        kinds.add(type_at(Place(*place)))
    data = "".join(text for _, text in drawn).encode("latin-1") + b"|"
    start = stop - np.array([len(text) for _, text in drawn])
    form, bits = forms_and_bits(kinds, np.arange(len(drawn)), data, start, stop)
    for (place, text), own_form, own_bits in zip(drawn, form.tolist(), bits.tolist(), strict=True):
        wanted = value_of(place, text)
        assert value_in(type_at(Place(*place)), text) == wanted
        if isinstance(wanted, str):
            assert own_form == Form.TEXT
        else:
            assert number_of(own_form, own_bits, place) == wanted


@examples(60)
@given(FIT, st.lists(TEXTS, min_size=2, max_size=2))
def test_equal_values_have_equal_bits(place: tuple[int, int, int, int], texts: list[str]) -> None:
    kinds = Kinds()
    kinds.add(type_at(Place(*place)))
    data = "".join(texts).encode("latin-1") + b"|"
    ends = np.cumsum([0, *map(len, texts)])
    form, bits = forms_and_bits(kinds, np.zeros(2, np.int64), data, ends[:-1], ends[1:])
    values = [value_of(place, text) for text in texts]
    are_equal = values[0] == values[1] if None not in values else texts[0] == texts[1] and values == [None, None]
    assert ((form[0], bits[0]) == (form[1], bits[1])) == are_equal
