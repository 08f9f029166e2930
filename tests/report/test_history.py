"""Changes of variables as lines: a number is never cut where something else can be left out."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.report.history import Text


def _told(old: Any, new: Any, old_text: str | None, new_text: str, width: int = 60) -> str:
    row = {
        "frame": 7, "time_ns": "1500000000", "list": "udp/1202/1", "list_name": "Batch", "sender": "10.0.0.1",
        "subindex": 0, "name": "pressure", "changed": True, "unit": None, "old": old, "new": new,
        "old_text": old_text, "new_text": new_text,
    }  # fmt: skip
    face = Text(["pressure", "speed"], [("udp/1202/1", "Batch")], width=width, utc=True)
    return face.line(row).splitlines()[-1]


def test_old_and_new_stand_side_by_side_where_both_fit() -> None:
    assert _told(1, 2, "1", "2").endswith("pressure  1 → 2")


@pytest.mark.parametrize("width", range(46, 80))
def test_a_number_that_does_not_fit_beside_the_old_one_stands_alone(width: int) -> None:
    old, new = 0.1234567890123456, -1.234567890123e-300
    line = _told(old, new, repr(old), repr(new), width)
    assert len(line) <= width
    assert line.endswith((f"{old!r} → {new!r}", f"  → {new!r}"))


@pytest.mark.parametrize("width", range(46, 80))
def test_a_first_number_is_whole(width: int) -> None:
    line = _told(None, -1.234567890123e-300, None, "-1.234567890123e-300", width)
    assert len(line) <= width
    assert line.removesuffix(" (first)").endswith("  -1.234567890123e-300")


def test_of_texts_the_begin_of_both_is_told() -> None:
    line = _told("a" * 50, "b" * 50, "a" * 50, "b" * 50)
    assert line.count("…") == 2
    assert "a…" in line
    assert "b…" in line
