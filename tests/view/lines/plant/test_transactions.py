"""What is said of transactions, in words of a row."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.view.lines.plant.content import Clock
from nvscope.view.lines.plant.transactions import pair_measures, transaction_measures, what

SAID = [{"name": "4,0,4,6", "old": None, "value": "???"}, {"name": "rSpeed", "old": "1", "value": "2"}]


def row(outcome: str, detail: str | None = None, operation: str = "write") -> dict[str, Any]:
    return {
        "operation": operation, "outcome": outcome, "detail": detail, "variables": SAID[operation == "write" :],
        "left_out": 3, "time_ns": "0",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("one", "told"),
    [
        (row("status", "HTTP status 500", "read"), "HTTP 500"),
        (row("refused", "HTTP status 403"), "refused: HTTP 403"),
        (row("refused", "ODErrorReplyAccess"), "refused: Access"),
        (row("status", None, "read"), "status"),
        (row("answered", None, "read"), "answered"),
    ],
)
def test_an_outcome_says_no_more_than_it_has_to(one: dict[str, Any], told: str) -> None:
    (cell,) = [
        column.cell(one) for column in transaction_measures(Clock(0, utc=True)) if column.column.title == "outcome"
    ]
    assert cell.text == told


def test_names_that_are_numbers_with_commas_are_told_apart() -> None:
    assert what(row("answered", operation="read")) == "4,0,4,6 = ???; rSpeed = 2; … 3 more"


@pytest.mark.parametrize("outcome", ["confirmed", "refused", "open", "unanswered"])
def test_the_last_write_tells_what_came_of_it_unless_it_was_done(outcome: str) -> None:
    (cell,) = [one.cell({"last_write": row(outcome)}) for one in pair_measures(0) if one.column.title == "last write"]
    assert cell.text == ("" if outcome == "confirmed" else f"{outcome}: ") + "rSpeed 1 → 2; … 3 more"
