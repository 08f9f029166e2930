"""The bars of intervals: what they say, in text and Markdown, at any width, and whatever lists are called."""

from __future__ import annotations

import copy
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.inquiry import Inquiry
from nvscope.report import markdown, text, timing
from nvscope.view.interval_shapes import IntervalShapes
from nvscope.view.lines.text_width import display_width
from tests.program_here import run

CAPTURES = Path(__file__).parents[2] / "captures"
BLOCKS = set(timing.LEVELS)


@cache
def read(name: str) -> tuple[dict[str, Any], IntervalShapes]:
    inquiry = Inquiry([str(CAPTURES / name)])
    found = inquiry.analyze()
    return inquiry.report(found), IntervalShapes(found.state, found.summary)


def section(name: str, width: int = 120, **how: bool) -> list[str]:
    document, shapes = read(name)
    lines = text.render(document, None, shapes, width=width, utc=True, **how).splitlines()
    start = lines.index(timing.TITLE)
    return lines[start : lines.index("", start)]


def test_each_sender_of_each_list_has_a_bar_with_the_ends_of_its_scale() -> None:
    lines = section("plant.pcapng.gz")
    assert lines[:3] == [
        "Timing",
        "list  sender             p50       p99      from  intervals                        to  beyond",
        "7     192.168.1.10   99.9 ms  100.9 ms   85.5 ms           ▁  ▁│█▅           110.6 ms       4",
    ]
    assert lines[3].split()[:2] == ["7", "192.168.1.99"]
    assert [line.split()[0] for line in lines[4:-2]] == ["12", "3", "9"]
    assert lines[-2].startswith("│ the nominal interval.")


def test_lists_on_can_have_bars_too() -> None:
    rows = section("can/press.log")[2:-2]
    assert len(rows) == 6
    assert all(BLOCKS & set(row) and timing.NOMINAL in row for row in rows)


def test_markdown_has_the_same_bars() -> None:
    document, shapes = read("plant.pcapng.gz")
    told = markdown.render(document, None, shapes, utc=True)
    assert "### Timing" in told
    _, titles, *rows, _, _ = section("plant.pcapng.gz")
    start = titles.index("intervals")
    for row in rows:
        assert row[start : start + timing.CELLS + 1] in told


def test_nobody_gets_bars_who_did_not_ask() -> None:
    document, _ = read("plant.pcapng.gz")
    assert timing.TITLE not in text.render(document, utc=True).splitlines()


@pytest.mark.parametrize("name", ["plant.pcapng.gz", "can/press.log", "peers/peers.pcap"])
@pytest.mark.parametrize("details", [False, True])
def test_no_line_is_wider_than_the_terminal(name: str, details: bool) -> None:
    for width in range(40, 200, 7):
        lines = section(name, width, details=details)
        assert max(map(display_width, lines)) <= width
        assert all(line == line.rstrip() for line in lines)


@given(st.text(st.characters(), min_size=1, max_size=40), st.integers(40, 200))
def test_whatever_lists_and_nodes_are_called_lines_are_printable_and_fit(poison: str, width: int) -> None:
    document, shapes = read("plant.pcapng.gz")
    named = copy.deepcopy(document)
    for entry in named["lists"]:
        entry["name"] = poison
        for node in entry["nodes"]:
            node["name"] = poison
    told = text.render(named, None, shapes, width=width, utc=True)
    assert all(line.isprintable() for line in told.split("\n"))
    assert max(display_width(line) for line in told.split("\n")) <= width
    assert "Timing" in markdown.render(named, None, shapes, utc=True)


def test_a_bar_is_highest_where_most_is_and_never_empty_where_something_is() -> None:
    assert timing.drawn([0, 1, 4, 1_000, 0, 500], 3) == " ▁▁│█ ▄"
    assert timing.drawn([0, 0], None) == "  "


def test_a_list_that_was_sent_once_has_none() -> None:
    document, shapes = read("telegrams.pcap")
    told = text.render(document, None, shapes, width=100, utc=True)
    assert f"Timing\n{timing.NO_INTERVALS}\n" in told


def test_bars_are_not_for_programs() -> None:
    done = run("report", str(CAPTURES / "plant.pcapng.gz"), "--timing", "--json")
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"--timing is drawn for people" in done.stderr
