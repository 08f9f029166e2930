"""Whether events that come again and again have ended, with its short ways against the whole reckoning."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nvscope.causes.case import Case
from nvscope.causes.spans import moments
from tests.laws import examples

MS = 1_000_000
NEAR = st.integers(0, 60)  # in parts of a moment and more


@given(st.lists(st.one_of(NEAR, st.integers(0, 3000)), min_size=1, max_size=40), st.integers(0, 4000), NEAR)
@examples(400)
def test_the_short_ways_tell_what_the_moments_tell(at_ms: list[int], left_ms: int, least_ms: int) -> None:
    times_ns = np.array(at_ms, np.int64) * 10 * MS
    case = Case.__new__(Case)
    case.facts = SimpleNamespace(at_ns=int(times_ns.max()) + left_ms * MS)  # type: ignore[assignment]
    first_ns, last_ns = int(times_ns.min()), int(times_ns.max())
    whole = case.end_of_many(first_ns, last_ns, moments(np.sort(times_ns)), least_ms * MS)
    assert case.end_of(times_ns, least_ms * MS) == whole
