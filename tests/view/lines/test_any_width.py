"""Tables, paragraphs and names of any text, on screens of any width: no error, and nothing wider where that can be."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nvscope.view.escape import visible
from nvscope.view.lines.short_names import bare_width, short_address, short_names
from nvscope.view.lines.table import GAP, Cell, Column, Line, Tone, align, wrap
from nvscope.view.lines.text_width import display_width, shorten, shorten_between
from tests.laws import examples

ODD = st.sampled_from(
    ["", "", " ", "   ", "\t", "\x1b", "\u200b", "\u0301", "e\u0301", "\u3000", "値", ",", "…", "[1]"]
)
TEXT = st.lists(ODD | st.sampled_from(["a", "Motor", "_", "/", "12", "0x18FF"]), max_size=12).map("".join).map(visible)
COLUMN = st.builds(
    Column, st.sampled_from(["variable", "stored", "x"]), st.booleans(), st.none() | st.integers(0, 3),
    st.sampled_from([0, 4, 12]), st.booleans(), st.booleans(), st.booleans(),
)  # fmt: skip


def plain(lines: list[Line]) -> list[str]:
    return ["".join(cell.text for cell in line) for line in lines]


@examples(200)
@given(st.lists(TEXT, max_size=8), st.integers(1, 40))
def test_names_of_any_text_fit_any_width(names: list[str], width: int) -> None:
    forms = short_names(names, width)
    assert forms.keys() == set(names)
    assert all(display_width(form) <= width for form in forms.values())
    assert bare_width(names) <= max(map(display_width, names), default=0) + 2
    for name in names:
        assert all(display_width(cut(name, width)) <= width for cut in (shorten, shorten_between, short_address))


@examples(200)
@given(st.data())
def test_tables_of_any_text_fit_any_width(data: st.DataObject) -> None:
    columns = data.draw(st.lists(COLUMN, min_size=1, max_size=4))
    rows = data.draw(st.lists(st.lists(TEXT.map(Cell), min_size=len(columns), max_size=len(columns)), max_size=5))
    width, indent = data.draw(st.integers(1, 40)), data.draw(st.sampled_from([0, 2, 10]))
    lines = plain(align(columns, rows, width, indent))
    assert len(lines) > len(rows)
    staying = sum(column.importance is None for column in columns)
    if width - min(indent, width // 2) >= max(staying, 1) * (GAP + 1) - GAP:
        assert [line for line in lines if display_width(line) > max(width, 2)] == []


@examples(200)
@given(st.lists(TEXT, max_size=5), st.integers(1, 40), st.sampled_from([0, 2, 10]), st.sampled_from([None, 0, 4, 10]))
def test_paragraphs_of_any_text_fit_any_width(texts: list[str], width: int, indent: int, hanging: int | None) -> None:
    lines = plain(wrap([Cell(text, Tone.PLAIN) for text in texts], width, indent, hanging))
    assert "".join(lines).replace(" ", "") == "".join(texts).replace(" ", "")
    # Beside an indentation of one, a wide character has no room on a screen of two or three columns.
    assert [line for line in lines if display_width(line) > max(width, 3)] == []
