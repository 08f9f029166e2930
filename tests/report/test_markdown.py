from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from nvscope.report import markdown
from nvscope.view.escape import visible

from .examples import EXAMPLES, HOSTILE, TROUBLED
from .test_text import poisoned

MARKDOWN = MarkdownIt("commonmark").enable(["table", "strikethrough"])


@pytest.mark.parametrize("example", ["clean", "troubled", "no-telegrams", "hostile", "alike"])
def test_golden(example: str, golden: Callable[[str, str], None]) -> None:
    golden(f"{example}.md", markdown.render(EXAMPLES[example], utc=True))
    golden(f"{example}.all.md", markdown.render(EXAMPLES[example], utc=True, everything=True))


def blocks(text: str) -> list[str]:
    """Return the block structure of a Markdown text, without what is written in it."""
    return [token.type for token in MARKDOWN.parse(text) if token.type != "inline"]


@given(st.text(st.characters(), min_size=1, max_size=30))
def test_no_text_changes_the_structure_or_brings_links_and_tags(poison: str) -> None:
    harmless = markdown.render(poisoned(TROUBLED, "x"), utc=True, everything=True)
    text = markdown.render(poisoned(TROUBLED, poison), utc=True, everything=True)
    # A column without a value is left out; keys of lists end with their number.
    if visible(poison).strip(" ").rpartition("/")[2].strip(" ") not in {"", "-"}:
        assert blocks(text) == blocks(harmless)
    for token in MARKDOWN.parse(text):
        kinds = {child.type for child in token.children or []}
        assert kinds <= {"text", "text_special", "code_inline", "strong_open", "strong_close", "em_open", "em_close"}


def test_sentences_render_as_they_were_written() -> None:
    rendered = "\n".join(
        "".join(child.content for child in token.children or [])
        for token in MARKDOWN.parse(markdown.render(HOSTILE, utc=True, everything=True))
    )
    for finding in HOSTILE["findings"]:
        assert visible(finding["message"]) in rendered
        assert f"Next: {visible(finding['hint'])}" in rendered


def test_every_row_of_a_table_has_every_cell() -> None:
    for example in EXAMPLES.values():
        rows = [line for line in markdown.render(example, utc=True).splitlines() if line.startswith("|")]
        assert len({line.replace("\\|", "").count("|") for line in rows}) <= 1
