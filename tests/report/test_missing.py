"""The section about what is missing: what stands there, how much of it, and that it harms no terminal."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.report import markdown, text, variables
from nvscope.view.lines.text_width import display_width

from .examples import CLEAN
from .test_text import poisoned

Row = dict[str, Any]


def row(kind: str, severity: str, what: str, why: str | None, *names: str, cut: int = 0) -> Row:
    return {
        "kind": kind, "severity": severity, "lists": ["udp/1202/7"], "list_name": "axis", "nodes": [],
        "variables": list(names), "variables_cut": cut, "what": what, "why": why, "next": "Do this.",
    }  # fmt: skip


ELSEWHERE = row("never-seen", "warning", "axis (7) was never seen", "10.0.0.1 sends it as list 9")
FOREIGN = row("header-foreign", "error", "No controller can read list 9", None)
RESTING = row("never-changed", "note", "6 variables of axis (7) never changed", None, "a", "b", "c", "d", "e", cut=1)
KINDS = {"kind", "severity", "lists"}


def shown(*rows: Row, width: int = 100, **how: Any) -> str:
    return text.render({**CLEAN, "missing": list(rows)}, width=width, utc=True, **how)


def section(*rows: Row, **how: Any) -> list[str]:
    lines = shown(*rows, **how).splitlines()
    start = lines.index("Missing")
    return lines[start : lines.index("", start)]


def test_each_entry_says_what_why_and_what_to_do() -> None:
    assert section(ELSEWHERE, FOREIGN, RESTING) == [
        "Missing",
        "! axis (7) was never seen: 10.0.0.1 sends it as list 9. Do this.",
        "✗ No controller can read list 9. Do this.",
        "· 6 variables of axis (7) never changed: a, b, c, d and 2 more. Do this.",
    ]


def test_it_stands_between_the_verdict_and_the_lists() -> None:
    lines = shown(ELSEWHERE).splitlines()
    table = next(place for place, line in enumerate(lines) if line.startswith("   list"))
    assert 0 < lines.index("Missing") < table


def test_nothing_is_said_where_nothing_is_missing() -> None:
    assert shown() == text.render(CLEAN, width=100, utc=True)


def test_more_than_eight_are_counted() -> None:
    several = [{**ELSEWHERE, "why": f"as list {number}"} for number in range(11)]
    assert section(*several)[-1] == "  3 more: --json has all."
    assert len(section(*several)) == 1 + 8 + 1
    assert len(section(*several, details=True)) == 1 + 11


def test_what_is_the_same_of_many_lists_is_said_once() -> None:
    unseen = row("never-seen", "warning", "axis (7) was never seen", None)
    assert section(*[unseen] * 6, *[RESTING] * 5)[1:] == [
        "! 6 lists were never seen: axis, axis, axis, axis and 2 more. Do this.",
        "· 30 variables of 5 lists never changed, others did: axis, axis, axis, axis and 1 more. Do this.",
    ]
    assert len(section(*[unseen] * 3, *[RESTING] * 3)) == 1 + 6
    assert len(section(*[unseen] * 6, *[RESTING] * 5, details=True)) == 1 + 11


def test_variables_begin_with_it() -> None:
    document = {"filter": None, "missing": [ELSEWHERE], "variables": [], "earlier": []}
    assert variables.render(document, width=100).splitlines()[1:] == [
        "", "Missing", "! axis (7) was never seen: 10.0.0.1 sends it as list 9. Do this.",
    ]  # fmt: skip


def test_markdown_has_the_same() -> None:
    told = markdown.render({**CLEAN, "missing": [ELSEWHERE, RESTING]}, utc=True).splitlines()
    assert "- ! **axis (7) was never seen**: 10.0.0.1 sends it as list 9. Do this." in told


@given(st.text(st.characters(), max_size=40), st.integers(40, 200))
def test_whatever_the_texts_hold_lines_are_printable_and_fit(poison: str, width: int) -> None:
    rows = [
        {key: item if key in KINDS else poisoned(item, poison) for key, item in one.items()}
        for one in (ELSEWHERE, FOREIGN, RESTING)
    ]
    document = {"filter": None, "missing": rows, "variables": [], "earlier": []}
    for told in (shown(*rows, width=width), variables.render(document, width=width)):
        assert all(line.isprintable() for line in told.split("\n"))
        assert max(display_width(line) for line in told.split("\n")) <= width


@pytest.mark.parametrize("width", [40, 57, 80, 200])
def test_it_is_as_wide_as_the_terminal_at_most(width: int) -> None:
    lines = section(ELSEWHERE, FOREIGN, RESTING, width=width)
    assert max(map(display_width, lines)) <= width
