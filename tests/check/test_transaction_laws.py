"""Laws of rules about requests: what the rules written frame by frame say, however a capture is cut."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.deciding import Decided
from nvscope.check.verdict import Judged, Verdict
from tests.check.requests import decided, of_frames
from tests.laws import examples
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.parameter_traffic import parameter_traffic
from tests.oracle.rules.parameter import observed
from tests.oracle.rules.timing import nearest_rank
from tests.oracle.rules.visu import Visu
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import batch_of, cut

FAIL, PASS = Verdict.FAIL, Verdict.PASS
LATENCY = {"check": "transaction", "max_latency": "20ms"}
ERRORS = {"check": "transaction", "max_errors": "10%"}
UNANSWERED = {"check": "transaction", "max_unanswered": 0}

LIMITS = st.sampled_from([1, 3, 249, 250, 300, 500, 900])


@examples(150)
@given(seed=st.integers(0, 10_000), most_ms=LIMITS, percent=st.integers(1, 100), share=st.integers(0, 100))
def test_what_becomes_of_requests_is_what_the_rules_say(seed: int, most_ms: int, percent: int, share: int) -> None:
    """Percentiles are those of the values themselves, and not of a histogram."""
    seed -= seed % 3 == 0  # of those, the clock steps
    frames = parameter_traffic(seed)
    rows = observed(frames).rows
    (fast,) = of_frames(frames, LATENCY | {"max_latency": f"{most_ms}ms", "percentile": percent})
    (good,) = of_frames(frames, ERRORS | {"max_errors": f"{share}%"})
    for (requester, partner, port), row in rows.items():
        of = str(requester), str(partner), port
        refused, ended = sum(row.errors.values()), row.replies + row.busy + row.timeouts
        if not row.requests or not (row.replies + row.busy + row.unexpected):
            continue
        latencies = sorted(row.latencies)
        if latencies:
            is_late = nearest_rank(latencies, percent) > most_ms * MILLISECOND
            judged = subject_of(fast, of)
            assert judged.verdict is (FAIL if is_late else PASS)
            assert judged.count == sum(one > most_ms * MILLISECOND for one in latencies)
            assert judged.worst == pytest.approx(nearest_rank(latencies, percent) / SECOND, rel=0.006, abs=1e-9)
        if ended:
            judged, bad = subject_of(good, of), refused + row.timeouts
            assert (judged.verdict, judged.count) == (FAIL if 100 * bad > share * ended else PASS, bad)


def subject_of(one: Decided, of: tuple[str, str, int]) -> Judged:
    """Return what was judged of a pair."""
    (found,) = [each for each in one.subjects if (each.node, each.partner, each.port) == of]
    return found


@examples(80)
@given(seed=st.integers(0, 10_000), most_ms=st.sampled_from([2, 20, 32, 1000, 1400]), percent=st.integers(1, 100))
def test_so_it_is_of_pages(seed: int, most_ms: int, percent: int) -> None:
    frames = visu_traffic(seed - seed % 4)  # of those, nothing is wrong with TCP, the capture or its clock
    rules = Visu()
    for frame in frames:
        rules.observe(frame)
    rule = {"protocol": "visu", "max_latency": f"{most_ms}ms", "percentile": percent}
    fast, good = of_frames(frames, LATENCY | rule, {**UNANSWERED, "protocol": "visu"})
    seen = False
    for (client, server, port), row in rules.known.items():
        of, latencies = (str(client), str(server), port), sorted(row.latencies)
        if latencies:
            seen = True
            judged = subject_of(fast, of)
            assert judged.verdict is (FAIL if nearest_rank(latencies, percent) > most_ms * MILLISECOND else PASS)
            assert judged.count == sum(one > most_ms * MILLISECOND for one in latencies)
            assert subject_of(good, of).count == row.counts["unanswered"]
    assert seen or not any(row.latencies for row in rules.known.values())


RULES = [
    LATENCY, LATENCY | {"percentile": 50, "when": "frame.number > 20"}, ERRORS, UNANSWERED,
    ERRORS | {"when": "frame.number < 60"},
]  # fmt: skip


@examples(60)
@given(seed=st.integers(0, 10_000), packets=st.integers(1, 90), visu=st.booleans(), warmup=st.integers(0, 3 * SECOND))
def test_any_cut_gives_the_same(seed: int, packets: int, visu: bool, warmup: int) -> None:
    frames = visu_traffic(seed) if visu else parameter_traffic(seed)
    whole = batch_of(frames)
    at_once, in_parts = (
        [(one.verdict, list(one.subjects)) for one in decided(batches, *RULES, warmup_ns=warmup)]
        for batches in ([whole], cut(whole, packets))
    )
    assert at_once == in_parts


@examples(60)
@given(seed=st.integers(0, 10_000), visu=st.booleans(), share=st.floats(0, 1))
def test_halves_make_a_whole(seed: int, visu: bool, share: float) -> None:
    """Wherever time is cut in two, each request was asked in one half or in the other."""
    seed -= seed % (4 if visu else 3) == 0
    frames = visu_traffic(seed - seed % 4) if visu else parameter_traffic(seed)
    at = 1 + round(share * len(frames))
    whole, early, late = of_frames(
        frames, ERRORS, ERRORS | {"when": f"frame.number < {at}"}, ERRORS | {"when": f"frame.number >= {at}"}
    )
    assert counts(whole) == counts(early) + counts(late)


def counts(one: Decided) -> int:
    return sum(each.count for each in one.subjects)
