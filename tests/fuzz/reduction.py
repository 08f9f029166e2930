"""Makes a file that fails smaller, as long as it fails in the same way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from tests.fuzz.anatomy import anatomy_of

Item = TypeVar("Item")

MOST_TRIES = 2000


def reduced(raw: bytes, fails: Callable[[bytes], bool], most_tries: int = MOST_TRIES) -> bytes:
    """Return a smaller file for which ``fails`` is true as it is for ``raw``: fewer records, then fewer bytes."""
    tries = [most_tries]
    anatomy = anatomy_of(raw)
    if anatomy is not None:
        kept = anatomy
        records = _fewer(anatomy.records, lambda few: fails(kept.with_records(list(few)).assembled()), tries)
        raw = anatomy.with_records(list(records)).assembled()
    for unit in (256, 16, 1):
        pieces = [raw[at : at + unit] for at in range(0, len(raw), unit)]
        raw = b"".join(_fewer(pieces, lambda few: fails(b"".join(few)), tries))
    return raw


def _fewer(items: Sequence[Item], fails: Callable[[Sequence[Item]], bool], tries: list[int]) -> Sequence[Item]:
    """Leave out runs of items, long ones first, as long as what is left fails."""
    run = max(len(items) // 2, 1)
    while run:
        at = 0
        while at < len(items) and tries[0]:
            tries[0] -= 1
            fewer = [*items[:at], *items[at + run :]]
            if fails(fewer):
                items = fewer
            else:
                at += run
        run //= 2
    return items
