"""Runs of telegrams that look alike, against a look at one telegram after the other."""

from __future__ import annotations

from itertools import groupby

from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.evidence.look_runs import MOST_OF_STREAM, LookRuns
from tests.laws import examples
from tests.oracle.builders import data_frame, telegram
from tests.packets import batch_of, cut, observed

CHECKSUM_PRESENT = 2
looks = st.tuples(st.integers(0, 1), st.sampled_from([2, 2, 4]), st.sampled_from([None, None, 7, 8]))


@given(st.lists(looks, min_size=1, max_size=150), st.integers(1, 40))
@examples(80)
def test_runs_are_those_of_one_telegram_after_the_other(sent: list[tuple[int, int, int | None]], packets: int) -> None:
    frames = [
        data_frame(
            number, "10.0.0.1", "255.255.255.255",
            telegram(
                subindex=subindex, counter=number, data=bytes(size), checksum=checksum or 0,
                flags=0 if checksum is None else CHECKSUM_PRESENT,
            ),
        )
        for number, (subindex, size, checksum) in enumerate(sent)
    ]  # fmt: skip
    found = observed(LookRuns(), cut(batch_of(frames), packets))
    first = [subindex for subindex, _, _ in sent]
    for stream, subindex in enumerate(dict.fromkeys(first)):
        own = [(number, 20 + size, checksum) for number, (at, size, checksum) in enumerate(sent) if at == subindex]
        groups = [list(group) for _, group in groupby(own, key=lambda one: one[1:])]
        assert [(run.items, run.length, run.checksum, run.telegrams, run.first_ns, run.last_ns)
                for run in found.runs_of(stream)] == [
            (1, group[0][1], group[0][2], len(group), group[0][0], group[-1][0]) for group in groups[:MOST_OF_STREAM]
        ]  # fmt: skip
