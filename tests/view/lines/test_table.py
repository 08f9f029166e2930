from __future__ import annotations

import re
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.view.escape import visible
from nvscope.view.lines.fit import cut
from nvscope.view.lines.table import NO_BREAK, Cell, Column, Line, Tone, align, wrap
from nvscope.view.lines.text_width import display_width, shorten

TEXT = st.text(st.characters(codec="utf-8"), max_size=40).map(visible) | st.text("ab 1値\u0301", max_size=60).map(
    visible
)


def plain(lines: list[Line]) -> list[str]:
    return ["".join(cell.text for cell in line) for line in lines]


@pytest.mark.parametrize(("text", "width"), [("abc", 3), ("", 0), ("値", 2), ("e\u0301", 1), ("ａ", 2), ("→", 1)])
def test_display_width(text: str, width: int) -> None:
    assert display_width(text) == width


@given(TEXT, st.integers(1, 50))
def test_shortened_text_fits_and_keeps_both_ends(text: str, width: int) -> None:
    short = shorten(text, width)
    assert display_width(short) <= width
    if short != text:
        head, _, tail = short.partition("…")
        assert text.startswith(head)
        assert text.endswith(tail)
        parts = re.findall(r"\\(?:x..|u.{4}|U.{8}|.)|[^\\]", text)
        assert head in accumulate(parts, initial="")
        assert tail in accumulate(reversed(parts), lambda behind, part: part + behind, initial="")


@given(TEXT, st.integers(1, 50))
def test_lines_are_cut_between_escapes(text: str, width: int) -> None:
    (short,) = plain([cut([Cell(text)], width)])
    assert len(short) <= width
    parts = re.findall(r"\\(?:x..|u.{4}|U.{8}|.)|[^\\]", text)
    assert short == text or short.removesuffix("…") in accumulate(parts, initial="")


def test_columns_are_aligned_left_and_right() -> None:
    columns = [Column("name"), Column("sent", right=True), Column("state")]
    rows = [[Cell("press"), Cell("5"), Cell("ok")], [Cell("値"), Cell("1 234"), Cell("")]]
    assert plain(align(columns, rows, 80)) == [
        "name    sent  state",
        "press      5  ok",
        "値     1 234",
    ]
    assert plain(align(columns, rows, 80, indent=2))[1] == "  press      5  ok"


def test_a_narrow_table_cuts_cells_then_leaves_out_the_least_important_columns() -> None:
    columns = [
        Column("key"),
        Column("name", importance=2, shortest=6),
        Column("a", importance=1),
        Column("b", importance=1),
    ]
    rows = [[Cell("udp/1202/7"), Cell("conveyor-left"), Cell("AAAA"), Cell("BBBB")]]
    assert plain(align(columns, rows, 37)) == [
        "key         name           a     b",
        "udp/1202/7  conveyor-left  AAAA  BBBB",
    ]
    assert plain(align(columns, rows, 33))[1:] == ["udp/1202/7  conv…left  AAAA  BBBB"]
    assert plain(align(columns, rows, 29))[1:] == ["udp/1202/7  conve…-left  AAAA", "Hidden: b (--wide shows it)"]
    assert plain(align(columns, rows, 18))[0].split() == ["key", "name"]
    assert " ".join(plain(align(columns, rows, 18))[2:]) == "Hidden: a, b (--wide shows them)"
    assert plain(align(columns, rows, 17))[1] == "udp/1202/7  AAAA"
    assert plain(align(columns, rows, 5))[1] == "ud…/7"
    assert plain(align(columns, rows, None)) == plain(align(columns, rows, 200))


def test_what_a_wide_column_leaves_room_for_is_shown_the_most_important_first() -> None:
    columns = [Column("key"), Column("low", importance=1), Column("wide", importance=3), Column("least", importance=0)]
    rows = [[Cell("udp/1202/7"), Cell("1"), Cell("x" * 30), Cell("2")]]
    assert plain(align(columns, rows, 50)) == [
        "key         low  wide",
        f"udp/1202/7  1    {'x' * 30}",
        "Hidden: least (--wide shows it)",
    ]
    assert plain(align(columns, rows, 46))[0].split() == ["key", "wide"]
    assert plain(align(columns, rows, 40)) == [
        "key         low  least",
        "udp/1202/7  1    2",
        "Hidden: wide (--wide shows it)",
    ]
    assert plain(align(columns, rows, 18))[0].split() == ["key", "low"]


def test_identifiers_lose_what_all_of_them_have_in_common() -> None:
    columns = [Column("list"), Column("name", shortest=12, identifier=True), Column("type", shortest=4)]
    rows = [[Cell("1"), Cell(f"GVL_NetVars_Station{number}_Send"), Cell("ARRAY[0..9] OF DINT")] for number in (1, 2)]
    assert plain(align(columns, rows, 22)) == [
        "list  name        type",
        "1     …Station1…  AR…T",
        "1     …Station2…  AR…T",
    ]
    assert plain(align(columns, rows, 60))[1] == "1     GVL_NetVars_Station1_Send  ARRAY[0..9] OF DINT"


@given(st.data())
def test_no_table_is_wider_than_asked_and_no_row_is_lost(data: st.DataObject) -> None:
    columns = data.draw(
        st.lists(
            st.builds(Column, st.sampled_from(["list", "sent", "値"]), st.booleans(), st.none() | st.integers(0, 3),
                      st.sampled_from([0, 4, 12])),
            min_size=1, max_size=6,
        )
    )  # fmt: skip
    rows = data.draw(st.lists(st.tuples(*[TEXT.map(Cell)] * len(columns)), max_size=5))
    least = 4 * len(columns)
    width = data.draw(st.integers(least, 120))
    lines = plain(align(columns, rows, width))
    table, below = lines[: len(rows) + 1], "".join("".join(lines[len(rows) + 1 :]).split())
    assert len(table) == len(rows) + 1
    hidden = below.removeprefix("Hidden:").partition("(--wideshows")[0].split(",") if below else []
    assert len(table[0].split()) + len(hidden) == len(columns)
    assert {*hidden} <= {column.title for column in columns if column.importance is not None}
    assert all(display_width(line) <= width for line in lines)
    assert all(line == line.rstrip(" ") for line in table)


def test_paragraphs_keep_tones_and_number_groups() -> None:
    lines = wrap([Cell("Next:", Tone.STRONG), Cell(" after 12 345 678 frames"), Cell("!", Tone.ERROR)], 14, 2, 4)
    assert plain(lines) == ["  Next: after", "    12 345 678", "    frames!"]
    assert lines[0][1:] == [Cell("Next:", Tone.STRONG), Cell(" after")]
    assert lines[2][-1] == Cell("!", Tone.ERROR)


def test_paragraphs_do_not_break_where_they_must_not() -> None:
    assert plain(wrap([Cell(f"lost{NO_BREAK}12, gaps{NO_BREAK}3")], 10)) == ["lost 12,", "gaps 3"]


@given(st.lists(st.tuples(TEXT, st.sampled_from(Tone)), max_size=4), st.integers(12, 60))
def test_paragraphs_fit_and_lose_no_character(parts: list[tuple[str, Tone]], width: int) -> None:
    lines = wrap([Cell(text, tone) for text, tone in parts], width, 3, 6)
    texts = plain(lines)
    assert all(display_width(text) <= width for text in texts)
    assert "".join(texts).replace(" ", "") == "".join(text for text, _ in parts).replace(" ", "")


@pytest.mark.parametrize(
    ("text", "width", "told"),
    [
        ("list 12 sub 0", 7, "list …"),
        ("list 12 sub 0", 9, "list 12 …"),
        ("EtherType 0x88cc, 56 bytes", 15, "EtherType …"),
        ("#1234", 4, "#…"),
    ],
)
def test_lines_are_cut_between_numbers(text: str, width: int, told: str) -> None:
    cells = [Cell(text[:6]), Cell(text[6:])]
    assert plain([cut(cells, width)]) == [told]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Hall-10-Line-10-Press-10, 10.0.0.1", ["Hall-10-Line-10-", "Press-10, 10.0.0.1"]),
        ("lists[].interval_ns.p95", ["lists[].interval_", "ns.p95"]),
        ("lists[].streams.p95", ["lists[].streams.", "p95"]),
        ("abcdefghijklmnopqr, x", ["abcdefghijklmnopq", "r, x"]),
        ("abcdefghijklmnopqrst", ["abcdefghijklmnopqr", "st"]),
    ],
)
def test_words_wider_than_a_line_break_at_their_seams_and_keep_their_comma(text: str, told: list[str]) -> None:
    assert plain(wrap([Cell(text)], 18)) == told
