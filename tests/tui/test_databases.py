"""Databases on the screen: their rows are packets, with a tree; no view fails of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from tests.tui.screen import Screen, on_screen

GENUINE = str(Path(__file__).parents[2] / "captures" / "datalogger" / "genuine-5min.db")


def test_rows_are_packets_with_a_tree() -> None:
    async def look(screen: Screen) -> None:
        rows = [line.split() for line in screen.lines if "db/genuine-5min.db" in line]
        assert rows
        assert any("I_2_IN01=" in word for row in rows for word in row)
        await screen.press("enter")
        assert "18 of 18, only changes are stored" in screen.text

    on_screen(Inquiry([GENUINE]), look, size=(140, 40), keys=["4"])


@pytest.mark.parametrize("key", list("12356789"))
def test_no_view_fails(key: str) -> None:
    async def look(screen: Screen) -> None:
        assert screen.lines

    on_screen(Inquiry([GENUINE]), look, size=(100, 30), keys=[key])
