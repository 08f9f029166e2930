"""Telegrams in quick succession: what follows from them is no fault of anybody."""

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


def test_cycles_of_a_burst_that_interleave_are_not_late(tmp_path: Path) -> None:
    frames = [
        data_frame(at_ms * MS + subindex * 3 * MS, "10.0.0.1", "10.0.0.2",
                   telegram(list_id=7, subindex=subindex, items=2, counter=counter + 900 * subindex))
        for counter, at_ms in enumerate(sorted([*range(0, 20_000, 50), 10_001]), 1) for subindex in (0, 1)
    ]  # fmt: skip
    (cause,) = causes_in(frames, tmp_path)
    assert (cause.kind.name, cause.severity.name) == ("sender-bursts", "NOTE")
    assert sorted({finding.code for finding in cause.findings}) == ["NV503", "NV505"]
