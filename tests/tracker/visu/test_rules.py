"""Requests of WebVisu pages and what becomes of them, against the rules written frame by frame."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.run import run
from nvscope.findings.judge import judge
from nvscope.protocols.table import accumulators_of
from nvscope.protocols.visu import VISU
from nvscope.tracker.parted import PartedState
from nvscope.tracker.state import TrackerState
from tests.laws import examples, some
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.rules.visu import Visu
from tests.oracle.tcp_line import tcp_frame
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import Batches, batch_of, cut, recorded
from tests.records import replace
from tests.tracker.visu.followed import by_the_rules, followed, reading, seen, told, writes_by_the_rules, writes_of

SEEDS = st.integers(0, 20_000)

BODIES_THAT_ASK_THE_SAME = 8088
"""Two requests in one packet read one variable, of which only one ends with a bar."""

A_RESET_FIRST = 4871
"""Both ports are claimed, and what comes first has all flags set."""

NO_BODY_OF_NO_LENGTH = 6141
"""A response of 204 says a length that cannot be."""

NO_STATUS = 13671
"""A response says 000."""

CUT_AND_OF_NO_LENGTH = 14686
"""The IP header leaves the length to hardware, and the capture cut the packet."""

A_LONG_VALUE = 16443
"""A text is written that fills a page."""

A_RESPONSE_IN_CHUNKS = 16601
"""What was taken for the first of the chunks of a response is another response."""

A_HOLE_BEFORE_THE_REQUEST_IS_WHOLE = 631
"""The rest of a request, and of the reply to it, are missing, and the next segment shows that of the reply first."""

A_SERVER_THAT_IS_HEARD_LATE = 4095
"""Replies were missed before the first one that was captured, which answers HEAD."""

A_REPLY_BEFORE_ITS_REQUEST = 277
"""The first reply was captured before its request, and the last request does not say how long it is."""

HEAD_BEHIND_A_REPLY_BEFORE_ITS_REQUEST = 78
"""The first reply was captured before its request; later, HEAD is answered."""

AN_OPEN_REQUEST_BEHIND_A_HOLE = 46
"""Nobody knows what answers a request behind a hole, and the next one does not say how long it is."""

HEARD_BEHIND_WHAT_WAS_ACKNOWLEDGED = 201
"""The server's direction begins behind what its client had, and one of the requests has no end."""

AN_OPEN_REQUEST_IN_FRONT_OF_HEAD = 244210881
"""Behind missing bytes, a request that does not say how long it is ends where bytes of the server are missing."""

HALF_OF_ALL_NUMBERS_AWAY = 374262756
"""A bit of an acknowledgement is wrong, so that it lies neither in front of what the server sends nor behind."""

CODED_AND_OF_NO_LENGTH = 56403007
"""Of a request, nobody knows where it ends, nor how it is coded."""

A_CLIENT_THAT_BEGINS_BEHIND_WHAT_ITS_SERVER_HAD = 526077621
"""Bytes of the client are missing in front of its first request, which is the first of the connection but SYN."""

HAD_LESS_THAN_IN_FRONT_OF_ITS_SERVER = 72643636
"""A bit of a client's acknowledgement is wrong, so that it lies in front of where its server was first heard."""

AN_OPEN_REQUEST_WHOSE_REPLY_IS_MISSING = 323060123
"""It ends where bytes of the server are missing, and is one of those that wait there."""

OF_NO_LENGTH_UP_TO_THE_END = 852052558
"""A response does not say how long it is, may answer HEAD, and is the last one."""

BEHIND_A_REPLY_THAT_MAY_ANSWER_WHAT_IS_MISSING = 808677729
"""HEAD is asked for behind requests of which nobody knows what answers them, since a reply begins in a hole."""

A_REPLY_TO_WHAT_HAD_BEGUN_THAT_IS_NONE = 181049845
"""A response came before its request was whole, as it seemed; more is missing behind it, and a write is refused."""

SINGULAR = (
    BODIES_THAT_ASK_THE_SAME, A_RESET_FIRST, NO_BODY_OF_NO_LENGTH, NO_STATUS, CUT_AND_OF_NO_LENGTH, A_LONG_VALUE,
    A_RESPONSE_IN_CHUNKS, A_HOLE_BEFORE_THE_REQUEST_IS_WHOLE, A_SERVER_THAT_IS_HEARD_LATE,
    A_REPLY_BEFORE_ITS_REQUEST, HEAD_BEHIND_A_REPLY_BEFORE_ITS_REQUEST, AN_OPEN_REQUEST_BEHIND_A_HOLE,
    HEARD_BEHIND_WHAT_WAS_ACKNOWLEDGED, AN_OPEN_REQUEST_IN_FRONT_OF_HEAD, HALF_OF_ALL_NUMBERS_AWAY,
    CODED_AND_OF_NO_LENGTH, A_CLIENT_THAT_BEGINS_BEHIND_WHAT_ITS_SERVER_HAD,
    HAD_LESS_THAN_IN_FRONT_OF_ITS_SERVER, AN_OPEN_REQUEST_WHOSE_REPLY_IS_MISSING,
    OF_NO_LENGTH_UP_TO_THE_END, BEHIND_A_REPLY_THAT_MAY_ANSWER_WHAT_IS_MISSING, A_REPLY_TO_WHAT_HAD_BEGUN_THAT_IS_NONE,
)  # fmt: skip


def near(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with times as far as a histogram tells them."""
    found = dict(row)
    for name in ("latency_ns", "polling_ns"):
        found[name] = {
            part: value if value is None or part not in ("p50", "p99") else pytest.approx(value, rel=0.01)
            for part, value in row[name].items()
        }
    return found


def later(frames: list[Frame]) -> list[Frame]:
    """Return frames, and one of other ports long behind them, as that of a list that goes on."""
    end_ns = max((frame.ts_ns for frame in frames), default=0)
    return [*frames, tcp_frame(end_ns + 20 * SECOND, ("10.0.0.1", 50_000), ("10.0.0.5", 1202))]


def expected(findings: list[dict[str, Any]], rules: Visu, frames: list[Frame]) -> list[dict[str, Any]]:
    """Return the findings of the rules; where the clock goes back, first and last may be times of any of their events.

    Events of several kinds are one finding, and nobody counts in which order one kind and another one came.
    """
    by_rules = rules.findings()
    goes_back = any(later.ts_ns < one.ts_ns for one, later in pairwise(frames))
    if not goes_back or len(by_rules) != len(findings):
        return by_rules
    times = {
        (code, str(client), variable): {time for time, _ in events}
        for (code, client, variable), events in rules.events().items()
    }
    return [
        one | {
            name: said[name] for name in ("first_ns", "last_ns")
            if said[name] in times[one["code"], one["client"], one["variable"]]
        }
        for one, said in zip(by_rules, findings, strict=True)
    ]  # fmt: skip


def check(frames: list[Frame]) -> None:
    rules: Visu = by_the_rules(frames)
    state = followed([batch_of(frames)])
    assert writes_of(state) == writes_by_the_rules(rules)
    rows, findings = told(state)
    assert rows == [near(row) for row in rules.rows()]
    assert findings == expected(findings, rules, frames)


@pytest.mark.parametrize("seed", [*some(range(160)), *SINGULAR])
def test_what_becomes_of_requests_is_what_the_rules_say(seed: int) -> None:
    check(visu_traffic(seed))


@examples(60)
@given(seed=SEEDS)
def test_so_it_is_of_any_traffic(seed: int) -> None:
    check(visu_traffic(seed))
    check(later(visu_traffic(seed)))


@examples(60)
@given(seed=SEEDS, packets=st.integers(1, 90))
def test_any_cut_gives_the_same(seed: int, packets: int) -> None:
    frames = later(visu_traffic(seed))
    parts, whole = followed(cut(batch_of(frames), packets)), followed([batch_of(frames)])
    assert told(parts) == told(whole)
    assert writes_of(parts) == writes_of(whole)


@examples(20)
@given(seed=SEEDS, parts=st.integers(1, 4))
def test_counted_in_parts_it_comes_to_the_same(seed: int, parts: int) -> None:
    frames = visu_traffic(seed)
    parted = PartedState(parts, others=lambda: accumulators_of([VISU]))
    followed(cut(batch_of(frames), 50), [parted])
    assert told(parted.join()) == seen(frames)


def test_behind_a_hole_in_which_nobody_listened_connections_begin_in_the_middle() -> None:
    first, second = visu_traffic(4), visu_traffic(8)
    later = [frame._replace(ts_ns=frame.ts_ns + 10**13) for frame in second]
    rows, _ = told(followed(recorded([batch_of(first)], [batch_of(later)])))
    alone = [seen(first)[0], seen(second)[0]]
    for name in ("connections", "reads", "writes", "replies", "unanswered", "cut"):
        assert sum(row[name] for row in rows) == sum(row[name] for part in alone for row in part)


def test_what_there_is_no_room_for_is_told() -> None:
    frames = visu_traffic(9)
    reading_of_few = replace(reading(), max_streams=2)
    state = TrackerState(others=accumulators_of([VISU]))
    for _ in run(Batches([batch_of(frames)]), reading_of_few, [state]):
        pass
    rows, _ = told(state)
    assert len(rows) == 2 < len(seen(frames)[0])
    (left_out,) = [one for one in judge(state) if one.code == "NV906"]
    for what in ("web visualization messages between further clients", "further variables of web visualization"):
        assert what in left_out.message
