"""Every counter and finding against an implementation of the same rules that goes frame by frame."""

from __future__ import annotations

import random

import pytest

from nvscope.engine.reading import Reading
from tests.laws import some
from tests.oracle.compare import differences
from tests.oracle.frame import Frame
from tests.oracle.reference import reference_report
from tests.oracle.traffic import generate, mutate
from tests.packets import batch_of, document_of, tracked


def traffic(seed: int) -> list[Frame]:
    choice = random.Random(seed)
    frames = generate(seed, frames=choice.choice([50, 300, 600]), link=choice.choice([1, 1, None]))
    return mutate(seed, frames) if seed % 3 == 0 else frames


@pytest.mark.parametrize("seed", some(range(90)))
def test_report_is_that_of_the_reference(seed: int) -> None:
    frames = traffic(seed)
    assert differences(reference_report(frames), document_of(tracked([batch_of(frames)]))) == []


@pytest.mark.parametrize("timeout_ns", [1, 10_000_000, 3_000_000_000])
def test_other_timeouts(timeout_ns: int) -> None:
    frames = traffic(7)
    state = tracked([batch_of(frames)], Reading(timeout_ns=timeout_ns))
    assert differences(reference_report(frames, timeout_ns=timeout_ns), document_of(state)) == []
