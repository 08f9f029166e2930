from __future__ import annotations

import codecs
import csv
import io
import re
import unicodedata
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from markdown_it.token import Token

from nvscope.view.escape import csv_safe, html_safe, markdown_code, markdown_safe, visible

ANY_TEXT = st.text(st.characters(), max_size=30)  # lone surrogates included
MARKED_TEXT = st.text(st.sampled_from("aB1 \\`*_~[]()<>|&$^{}!-+=#.@:/w;\"'\n\t\x1b\u202e\u0301é"), max_size=20)
TEXT = ANY_TEXT | MARKED_TEXT


def read_back(shown: str) -> str:
    """Undo ``visible`` with an independent reader of backslash escapes."""
    return re.sub(
        r"\\(?:\\|[tnr]|x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8})",
        lambda match: codecs.decode(match.group().encode("ascii"), "unicode_escape"),
        shown,
    )


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("", ""),
        ("Förderband 3 → Presse, 値", "Förderband 3 → Presse, 値"),
        ("\x1b[31mred\x1b[0m", r"\x1b[31mred\x1b[0m"),
        ("\x9b2J", r"\x9b2J"),
        ("a\x00b\x7f\x85", r"a\x00b\x7f\x85"),
        ("two\nlines\r\n\ttab", r"two\nlines\r\n\ttab"),
        ("C:\\new", r"C:\\new"),
        ("\u202egpj.exe\u2066\u200f\u061c", r"\u202egpj.exe\u2066\u200f\u061c"),
        ("a\u200bb\ufeffc\u00add", r"a\u200bb\ufeffc\xadd"),
        ("a\u2028b\u2029c\u00a0d\u3000e", r"a\u2028b\u2029c\xa0d\u3000e"),
        ("\udc80", r"\udc80"),
        ("\U000e0041\U000f0000", r"\U000e0041\U000f0000"),
        ("a\ufe0fb\u3164c\u2800", r"a\ufe0fb\u3164c\u2800"),
        ("e\u0301 \u0301", "e\u0301 \\u0301"),
        ("\u0301", r"\u0301"),
        ("e" + "\u0301" * 4, "e" + "\u0301" * 3 + r"\u0301"),
        ("[bold]no markup[/bold]", "[bold]no markup[/bold]"),
    ],
)
def test_visible_examples(text: str, shown: str) -> None:
    assert visible(text) == shown


@given(TEXT)
def test_visible_text_is_printable_and_can_be_read_back(text: str) -> None:
    assert visible(text).isprintable()
    assert read_back(visible(text)) == text


@pytest.mark.parametrize("plane", range(17))
def test_no_character_of_unicode_gets_through_that_acts_hides_or_turns(plane: int) -> None:
    turning = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI", "BN", "B", "S"}
    shown = set(visible("x".join(chr(plane << 16 | code) for code in range(0x10000)))) - {" "}
    assert len(shown) > 10
    for character in shown:
        assert unicodedata.category(character) not in {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp", "Zs"}, ascii(character)
        assert unicodedata.bidirectional(character) not in turning, ascii(character)


class _TextOf(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.text = ""
        self.tags: list[str] = []
        self.attributes: list[str | None] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += (value for _, value in attrs)

    def handle_data(self, data: str) -> None:
        self.text += data


@given(TEXT)
def test_html_shows_the_visible_text_and_no_tag_of_its_own(text: str) -> None:
    page = _TextOf()
    page.feed(f"<p title=\"{html_safe(text)}\" id='{html_safe(text)}'>{html_safe(text)}</p>")
    page.close()
    assert page.tags == ["p"]
    assert page.attributes == [visible(text)] * 2
    assert page.text == visible(text)


@given(TEXT)
def test_csv_cells_are_no_formulas_and_stay_different(text: str) -> None:
    file = io.StringIO()
    csv.writer(file).writerow([csv_safe(text), "next"])
    (row,) = csv.reader(io.StringIO(file.getvalue()))
    assert row == [csv_safe(text), "next"]
    assert not row[0].lstrip(" ").startswith(("=", "+", "-", "@", "\t", "\r", "＝", "＋", "－", "＠"))
    assert visible(text) == (row[0][1:] if row[0].startswith("'") else row[0])


@pytest.mark.parametrize("cell", ["=1+1", "+1", "-1", "@SUM(A1)", " =1", "＝1", "'=1"])
def test_csv_marks_what_a_spreadsheet_would_compute(cell: str) -> None:
    assert csv_safe(cell) == f"'{cell}"


@pytest.mark.parametrize("cell", ["\t=1", "\r=1", "a=1", "1-1", ""])
def test_csv_leaves_what_is_no_formula(cell: str) -> None:
    assert csv_safe(cell) == visible(cell)


MARKDOWN = MarkdownIt("commonmark").enable(["table", "strikethrough"])


def inline(markdown: str, *around: str) -> list[Token]:
    """Return the inline tokens of a text that must render to the blocks given and nothing else."""
    tokens = MARKDOWN.parse(markdown)
    blocks = [token.type for token in tokens if token.type != "inline" and not token.type.endswith("_close")]
    assert blocks == list(around)
    return [child for token in tokens if token.type == "inline" for child in token.children or []]


@given(TEXT)
def test_markdown_prose_renders_as_the_visible_text(text: str) -> None:
    shown = visible(text).strip(" ")
    tokens = inline(markdown_safe(text.strip(" ")), *(["paragraph_open"] if shown else []))
    assert {token.type for token in tokens} <= {"text", "text_special", "code_inline"}
    assert "".join(token.content for token in tokens) == shown
    prose = "".join(token.content if token.type != "code_inline" else "\n" for token in tokens)
    assert not re.search(r"://|www\.|@\w|#\d+\b", prose, re.IGNORECASE)


@given(TEXT)
def test_markdown_prose_stays_within_its_table_cell(text: str) -> None:
    cell = ["table_open", "thead_open", "tr_open", "th_open", "th_open", "tbody_open", "tr_open", "td_open", "td_open"]
    tokens = inline(f"| a | b |\n|---|---|\n| {markdown_safe(text)} | next |", *cell)
    assert "".join(token.content for token in tokens) == f"ab{visible(text).strip(' ')}next"


@given(TEXT)
def test_markdown_code_is_one_code_span_of_the_visible_text(text: str) -> None:
    shown = visible(text).replace("|", r"\x7c")
    tokens = inline(f"a{markdown_code(text)}b", "paragraph_open")
    if text:
        assert [token.type for token in tokens] == ["text", "code_inline", "text"]
        assert tokens[1].content == shown
    assert "|" not in markdown_code(text)


@pytest.mark.parametrize(
    ("text", "markdown"),
    [
        ("a_b*c", r"a\_b\*c"),
        ("<b>[x](y)`", r"\<b\>\[x\](y)\`"),
        ("1. one", r"1\. one"),
        ("- item", r"\- item"),
        ("# title", r"\# title"),
        ("see #12, T#12s", "see `#`12, T#12s"),
        ("ask @all, https://x", "ask `@`all, https`://`x"),
        ("a|b", r"a\|b"),
    ],
)
def test_markdown_examples(text: str, markdown: str) -> None:
    assert markdown_safe(text) == markdown
