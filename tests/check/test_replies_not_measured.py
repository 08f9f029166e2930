"""Rules about how long replies take, where nobody knows how long some of them, or all, took."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nvscope.check.checks.transactions import DISORDER, UNMEASURED
from nvscope.check.verdict import Verdict
from tests.check.requests import READ_X, VALUE, of_frames, page, post, reply
from tests.check.test_transaction_laws import subject_of
from tests.laws import examples
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.rules.timing import nearest_rank
from tests.oracle.rules.visu import Visu
from tests.oracle.tcp_line import SERVER, Line
from tests.oracle.visu_traffic import visu_traffic

FAIL, PASS, OPEN = Verdict.FAIL, Verdict.PASS, Verdict.INCONCLUSIVE
RULE: dict[str, Any] = {"check": "transaction", "protocol": "visu", "max_latency": "20ms"}
REFUSED = b"HTTP/1.1 413 x\r\nContent-Length: 2\r\n\r\nno"


def line(*, early: int, slow: int, of: int) -> Line:
    """Return a connection with so many requests, of which some are answered before they are whole, and some late."""
    found = page()
    for number in range(of):
        request = post(READ_X)
        if number < early:
            found.ask(request[:-5]).answer(REFUSED).ask(request[-5:])
        else:
            found.ask(request).wait(50 * MILLISECOND if number < early + slow else 0).answer(reply(VALUE))
    return found


@pytest.mark.parametrize(
    ("early", "slow", "percentile", "expected"),
    [
        (0, 0, 90, PASS), (1, 0, 90, PASS), (2, 0, 90, OPEN), (2, 0, 80, PASS), (1, 1, 90, OPEN), (1, 1, 80, PASS),
        (1, 2, 90, FAIL), (10, 0, 90, OPEN), (9, 1, 90, OPEN), (8, 2, 90, FAIL),
    ],
)  # fmt: skip
def test_what_has_no_latency_may_have_been_slow(early: int, slow: int, percentile: int, expected: Verdict) -> None:
    (one,) = of_frames(line(early=early, slow=slow, of=10).frames, RULE | {"percentile": percentile})
    (judged,) = one.subjects
    assert judged.verdict is expected
    assert (judged.reason == f"{early} of 10 replies {UNMEASURED}") is (expected is OPEN)


@pytest.mark.parametrize("away_ms", [-3, 3, -30])
@pytest.mark.parametrize("wait_ms", [10, 40])
def test_by_two_clocks_nothing_is_known(away_ms: int, wait_ms: int) -> None:
    """Where the clock of the server is behind, replies come before their requests, or seem to be quicker."""
    talk = page()
    for _ in range(10):
        talk.ask(post(READ_X)).segment(False).wait(wait_ms * MILLISECOND).answer(reply(VALUE)).segment(True)
    (whole,) = of_frames(talk.frames, RULE)
    assert whole.verdict is (FAIL if wait_ms > 20 else PASS)
    shifted = [one._replace(ts_ns=one.ts_ns + away_ms * MILLISECOND) if by_server(one) else one for one in talk.frames]
    (one,) = of_frames(sorted(shifted, key=lambda frame: frame.ts_ns), RULE)
    (judged,) = one.subjects
    assert judged.verdict is OPEN
    assert judged.reason == DISORDER or UNMEASURED in judged.reason


def by_server(frame: Frame) -> bool:
    return frame.data[34:36] == SERVER[1].to_bytes(2, "big")


@examples(120)
@given(seed=st.integers(0, 10_000), most_ms=st.sampled_from([2, 20, 32, 1000, 1400]), percent=st.integers(1, 100))
def test_of_any_traffic_no_verdict_says_more_than_the_rules_know(seed: int, most_ms: int, percent: int) -> None:
    frames = visu_traffic(seed)
    rules = Visu()
    for frame in frames:
        rules.observe(frame)
    assume(not rules.happened["part of a request refused"])  # which are replies, and of no row
    held = rules.streams.held.disordered
    in_disorder = {(client[0], *rules.streams.servers[pair]) for pair in held for client in pair}
    (fast,) = of_frames(frames, RULE | {"max_latency": f"{most_ms}ms", "percentile": percent})
    for (client, server, port), row in rules.known.items():
        if not row.latencies:
            continue
        judged = subject_of(fast, (str(client), str(server), port))
        more = row.counts["replies"] - len(row.latencies)
        if judged.verdict is PASS:
            assert nearest_rank(sorted([*row.latencies, *[SECOND * 10**6] * more]), percent) <= most_ms * MILLISECOND
        if judged.verdict is FAIL:
            assert nearest_rank(sorted([*row.latencies, *[0] * more]), percent) > most_ms * MILLISECOND
        assert judged.verdict is OPEN or (client, server, port) not in in_disorder
