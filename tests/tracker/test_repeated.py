"""Repeated telegrams take no step: what is left of a sequence is walked as if they were not there."""

from __future__ import annotations

import random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.repeated import Repeated
from nvscope.tracker.steps import Step, walk_one
from tests.laws import examples
from tests.tracker.test_sequence import sequences


@given(sequences(), st.randoms(use_true_random=False))
@examples(400)
def test_they_take_no_step_wherever_they_are(
    parts: list[tuple[list[int], int | None, int]], choice: random.Random
) -> None:
    shown: list[tuple[int, bool]] = []
    start, steps, distances, currents, words = [], [], [], [], []
    for counters, current, missing in parts:
        # The first telegram of all is none that was there before.
        again = [choice.random() < 0.3 and not (current is None and not place) for place in range(len(counters))]
        start.append(len(shown))
        shown += zip(counters, again, strict=True)
        taken = [counter for counter, repeated in zip(counters, again, strict=True) if not repeated]
        step, distance, after, word = walk_one(taken, current, missing) if taken else ([], [], current, missing)
        left = iter(zip(step, distance, strict=True))
        both = [(Step.LATE, None) if repeated else next(left) for repeated in again]
        steps += [step for step, _ in both]
        distances += [distance for _, distance in both]
        currents.append(after)
        words.append(word)
    # What a repeated telegram itself has for a Counter is of no matter.
    counter = np.array([choice.randrange(65536) if again else counter for counter, again in shown], np.uint16)
    place = np.flatnonzero([again for _, again in shown])
    walked = Repeated(place, np.array(start)).walk(
        counter,
        np.array([current or 0 for _, current, _ in parts], np.uint16),
        np.array([missing for _, _, missing in parts], np.uint64),
        np.array([current is None for _, current, _ in parts]),
    )
    assert walked.step.tolist() == steps
    told = [None if again else distance for distance, (_, again) in zip(walked.distance.tolist(), shown, strict=True)]
    assert told == distances
    assert walked.current.tolist() == currents
    assert walked.missing.tolist() == words
    assert walked.irregular.tolist() == np.flatnonzero(walked.step != Step.REGULAR).tolist()


def test_they_have_what_the_telegram_in_front_has() -> None:
    column = np.arange(10)
    Repeated(np.array([0, 1, 3, 5, 6, 9]), np.array([0, 5, 8])).pass_over(column, np.array([100, 101, 102]))
    assert column.tolist() == [100, 100, 2, 2, 4, 101, 101, 7, 8, 8]
