"""Waits that the next telegram ends before their reader had the time to answer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.causes.plants import causes_in
from tests.oracle.builders import ACKNOWLEDGEMENT, data_frame, telegram
from tests.oracle.frame import Frame

MS = 1_000_000
ANSWER_MS = 11


def exchange(at_ms: list[int], without_answer: set[int]) -> Iterator[Frame]:
    """Yield telegrams at some times, each but some answered after 11 ms."""
    for counter, at in enumerate(at_ms, 1):
        sent = telegram(list_id=7, counter=counter, flags=1)
        yield data_frame(at * MS, "10.0.0.1", "10.0.0.2", sent)
        if at not in without_answer:
            answer = telegram(ACKNOWLEDGEMENT, list_id=7, counter=counter, items=0, data=b"")
            yield data_frame((at + ANSWER_MS) * MS, "10.0.0.2", "10.0.0.1", answer)


@pytest.mark.parametrize(
    ("further_ms", "kinds"),
    [
        (9, []),  # sooner than the reader answers: nobody knows whether it would have
        (30, ["reader-silent"]),
    ],
)
def test_who_answers_slowly_is_not_blamed_for_telegrams_that_follow_sooner(
    further_ms: int, kinds: list[str], tmp_path: Path
) -> None:
    at_ms = list(range(0, 20_000, 50))
    frames = exchange(sorted([*at_ms, 10_000 + further_ms]), {10_000})
    causes = causes_in(list(frames), tmp_path)
    assert [cause.kind.name for cause in causes if cause.severity.name != "NOTE"] == kinds
