"""How far actions of moving go."""

from __future__ import annotations


def step_of(action: str, page: int, count: int) -> int | None:
    """Return how many rows an action goes, of ``count`` with ``page`` of them in view; None if it is none of moving."""
    page = max(page, 1)
    return {
        "move.down": 1, "move.up": -1, "move.page-down": page, "move.page-up": -page,
        "move.half-page-down": max(page // 2, 1), "move.half-page-up": -max(page // 2, 1),
        "move.first": -count, "move.last": count,
    }.get(action)  # fmt: skip
