"""Requests of the Parameter Manager and what becomes of them, against the rules written frame by frame."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import asdict
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import Struct, structs

from nvscope.engine.reading import Reading
from nvscope.findings.judge import judge
from nvscope.tracker.parameter.transactions import Transactions
from nvscope.tracker.parameter.writes import Outcome
from nvscope.tracker.parted import PartedState
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.documents.parameters import sdo_rows
from tests.laws import examples, some
from tests.oracle.builders import MILLISECOND, data_frame, telegram
from tests.oracle.compare import with_near_latencies
from tests.oracle.frame import Frame
from tests.oracle.parameter_traffic import conversations, parameter_traffic
from tests.oracle.rules.parameter import FRAMES_KEPT, VALUE_BYTES, parameters
from tests.oracle.rules.parameter import observed as observed_by_rules
from tests.packets import batch_of, cut, observed, tracked

ASKING, ASKED = "10.0.0.1", "10.0.0.2"
CODES = ("NV701", "NV702", "NV703", "NV704")


def told(state: TrackerState) -> tuple[list[dict[str, Any]], list[tuple[Any, ...]]]:
    """Return the rows of the report, and the findings, as ``parameters`` does."""
    summary = summarize(state)
    found = [
        (one.code, None if one.node is None else summary.addresses[one.node], one.variable, one.count, one.first_ns,
         one.last_ns, sorted(one.frames) if one.count <= FRAMES_KEPT else [])
        for one in judge(state, summary=summary) if one.code in CODES
    ]  # fmt: skip
    return sdo_rows(summary.parameters), sorted(found, key=str)


def written(state: TrackerState) -> list[dict[str, Any]]:
    """Return what is known of all writes."""
    known = state.parameters.known
    return [] if known is None else [_told(one) for one in known.writes.kept]


def _told(one: Struct) -> dict[str, Any]:
    whole = structs.asdict(one)
    return {key: structs.asdict(value) if isinstance(value, Struct) else value for key, value in whole.items()}


def written_by_rules(frames: list[Frame], timeout_ns: int = 500 * MILLISECOND) -> list[dict[str, Any]]:
    """Return what is to be known of all writes, as ``written`` does."""
    names = {"time": "time_ns", "answer": "answer_frame", "size": "size_bytes"}
    return [
        asdict(one, dict_factory=lambda entries: {names.get(key, key): value for key, value in entries})
        for one in observed_by_rules(frames, timeout_ns).writes
    ]


def check(frames: list[Frame], state: TrackerState, timeout_ns: int = 500 * MILLISECOND) -> None:
    rows, findings = parameters(frames, timeout_ns)
    actual_rows, actual = told(state)
    assert actual_rows == [with_near_latencies(row) for row in rows]
    assert written(state) == written_by_rules(frames, timeout_ns)
    # Who is asked by everybody has no number.
    named = {one[1] for one in actual}
    assert [one if one[1] in named else (one[0], None, *one[2:]) for one in actual] == sorted(
        ((code, node if node in named else None, *rest) for code, node, *rest in findings), key=str
    )


@pytest.mark.parametrize("seed", some(range(120)))
def test_what_becomes_of_requests_is_what_the_rules_say(seed: int) -> None:
    frames = parameter_traffic(seed)
    check(frames, tracked([batch_of(frames)]))


@pytest.mark.parametrize("timeout_ns", [1, 100 * MILLISECOND, 2_000 * MILLISECOND])
def test_other_timeouts(timeout_ns: int) -> None:
    frames = parameter_traffic(5)
    check(frames, tracked([batch_of(frames)], Reading(parameter_timeout_ns=timeout_ns)), timeout_ns)


@examples(40)
@given(seed=st.integers(0, 10_000), packets=st.integers(1, 60))
def test_any_cut_gives_the_same(seed: int, packets: int) -> None:
    frames = parameter_traffic(seed)
    state, whole = tracked(cut(batch_of(frames), packets)), tracked([batch_of(frames)])
    assert (told(state), written(state)) == (told(whole), written(whole))


@examples(20)
@given(seed=st.integers(0, 10_000), parts=st.integers(1, 4))
def test_counted_in_parts_it_comes_to_the_same(seed: int, parts: int) -> None:
    frames = parameter_traffic(seed)
    parted, whole = observed(PartedState(parts), cut(batch_of(frames), 50)).join(), tracked([batch_of(frames)])
    assert (told(parted), written(parted)) == (told(whole), written(whole))


def test_the_traffic_shows_everything() -> None:
    seen: Counter[str] = Counter()
    for seed in range(60):
        rows, findings = parameters(parameter_traffic(seed))
        for row in rows:
            seen.update({key: value for key, value in row.items() if isinstance(value, int)})
            seen.update(row["errors"])
        seen.update(code for code, *_ in findings)
        for write in observed_by_rules(parameter_traffic(seed)).writes:
            seen.update([write.outcome, "new cut" if len(write.new.data) < write.new.size else "new"])
            seen.update(["no old" if write.old is None else "old cut" if write.old.size > VALUE_BYTES else "old"])
    assert min(seen[outcome] for outcome in (*Outcome, "new", "new cut", "old", "old cut", "no old")) > 20
    rows = "requests", "replies", "busy", "timeouts", "retransmissions", "unexpected", "undeliverable", "copies"
    wanted = (*rows, *CODES)
    assert min(seen[name] for name in wanted) > 20
    assert sum(name.startswith("OD") for name in seen) == 9


def exchange(*steps: tuple[int, int, int]) -> list[Frame]:
    """Return telegrams of one parameter: when in ms, the service, and Counter."""
    return [
        data_frame(
            at_ms * MILLISECOND, *((ASKING, ASKED) if service in (1, 3) else (ASKED, ASKING)),
            telegram(service, 0x2000, 1, counter=counter, data=b""),
        )
        for at_ms, service, counter in steps
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("steps", "figures", "codes"),
    [
        ([(0, 1, 7), (3, 2, 7)], {"requests": 1, "replies": 1}, []),
        ([(0, 3, 7), (500, 4, 7)], {"requests": 1, "replies": 1}, ["NV704"]),
        ([(0, 3, 7), (501, 4, 7)], {"requests": 1, "timeouts": 1, "unexpected": 1}, ["NV701", "NV703"]),
        ([(0, 1, 7), (400, 1, 7), (800, 2, 7)], {"requests": 1, "retransmissions": 1, "replies": 1}, ["NV704"]),
        ([(0, 1, 7), (400, 1, 7)], {"requests": 1, "retransmissions": 1}, []),
        ([(0, 1, 7), (501, 1, 7)], {"requests": 2, "timeouts": 1}, ["NV701"]),
        ([(0, 1, 7), (3, 23, 7)], {"requests": 1, "replies": 1, "errors": {"ODErrorReplyIdx": 1}}, ["NV702"]),
        ([(0, 1, 7), (3, 100, 7)], {"requests": 1, "busy": 1}, []),
        ([(0, 1, 7), (3, 4, 7)], {"requests": 1, "unexpected": 1}, ["NV703"]),
        ([(0, 1, 7), (3, 2, 8)], {"requests": 1, "unexpected": 1}, ["NV703"]),
        ([(0, 1, 7), (1, 3, 7), (2, 28, 7), (3, 2, 7)],
         {"requests": 2, "replies": 2, "errors": {"ODErrorReplyCPUStopped": 1}}, ["NV702"]),
        ([(0, 2, 7)], {"unexpected": 1}, ["NV703"]),
    ],
)  # fmt: skip
def test_an_exchange(steps: list[tuple[int, int, int]], figures: dict[str, Any], codes: list[str]) -> None:
    rows, findings = told(tracked([batch_of(exchange(*steps))]))
    (row,) = rows
    nothing = {
        "requests": 0,
        "replies": 0,
        "errors": {},
        "busy": 0,
        "timeouts": 0,
        "retransmissions": 0,
        "unexpected": 0,
    }
    assert {name: row[name] for name in nothing} == nothing | figures
    assert [code for code, *_ in findings] == codes
    assert {variable for _, _, variable, *_ in findings} <= {f"sdo/{ASKED}/0x2000:1"}


def test_what_is_overdue_counts_where_time_passes_by_itself() -> None:
    state = tracked([batch_of(exchange((0, 1, 7)))])
    assert told(state)[1] == []
    overdue = judge(state, at_ns=501 * MILLISECOND)
    assert [(one.code, one.first_ns, one.frames) for one in overdue if one.code == "NV701"] == [
        ("NV701", 500 * MILLISECOND, (1,))
    ]


def test_without_such_telegrams_there_is_nothing() -> None:
    state = tracked([batch_of([data_frame(0, ASKING, ASKED, telegram())])])
    assert told(state) == ([], [])


def test_there_is_a_limit_for_those_who_make_up_requests() -> None:
    chance = random.Random(1)
    frames = [
        data_frame(number, ASKING, ASKED, telegram(1, chance.randrange(65536), 0, counter=number % 65536, data=b""))
        for number in range(3_000)
    ]  # fmt: skip
    state = tracked([batch_of(frames)], Reading(max_streams=100))
    known = state.parameters.known
    assert isinstance(known, Transactions)
    assert len(known.parameters) == 100
    assert told(state)[0][0]["requests"] == 3_000


def test_where_nobody_asks_nothing_is_kept() -> None:
    assert tracked([batch_of([data_frame(0, ASKING, "255.255.255.255", telegram(0, 1))])]).parameters.known is None


def test_conversations_are_in_order() -> None:
    times = [frame.ts_ns for frame in conversations(3)]
    assert times == sorted(times)


def limits_told(state: TrackerState) -> list[str]:
    return [one.message.partition("Left out: ")[2] for one in judge(state) if one.code == "NV906"]


def asked(count: int, *, replies: bool = True) -> list[Frame]:
    """Return so many requests at one time, each with another Counter, and their replies."""
    last = 2 * count if replies else count
    return exchange(*((at, 1 if at < count else 2, at % count) for at in range(last)))


def test_requests_that_nobody_keeps_are_told_and_their_replies_are_not_unexpected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("nvscope.tracker.parameter.transactions.MOST_OPEN", 3)
    frames = [*asked(5), *exchange((600, 2, 9))]
    state = tracked(cut(batch_of(frames), 5))
    ((row,), findings) = told(state)
    assert (row["requests"], row["replies"], row["unexpected"]) == (5, 3, 1)
    assert [(one[0], one[3]) for one in findings] == [("NV703", 1)]
    assert limits_told(state) == [
        "2 Parameter Manager requests beyond the 3 that are waited for at a time; "
        "2 Parameter Manager replies that may be to one of these."
    ]
    parted = observed(PartedState(2), cut(batch_of(frames), 5)).join()
    assert (told(parted), limits_told(parted)) == (told(state), limits_told(state))


def test_parameters_beyond_the_limit_are_told() -> None:
    frames = [
        data_frame(index * MILLISECOND, ASKING, ASKED, telegram(1, 0x2000 + index, 0, data=b"")) for index in range(5)
    ]
    later = data_frame(900 * MILLISECOND, ASKING, ASKED, telegram(0, 1))
    state = tracked([batch_of([*frames, later])], Reading(max_streams=2))
    ((row,), findings) = told(state)
    assert (row["requests"], row["timeouts"], len(findings)) == (5, 5, 2)
    assert limits_told(state) == ["3 events of further parameters."]
    assert limits_told(tracked([batch_of([*frames, later])])) == []


def said(at_ms: int, service: int, value: bytes = b"", ports: tuple[int, int] = (1202, 1202)) -> Frame:
    """Return a telegram of one parameter with one Counter, from a port to another one."""
    ends = (ASKING, ASKED) if service in (1, 3) else (ASKED, ASKING)
    payload = telegram(service, 0x2000, 1, counter=7, data=value)
    return data_frame(at_ms * MILLISECOND, *ends, payload, source_port=ports[0], port=ports[1])


@pytest.mark.parametrize(
    ("asked", "replied", "port"),
    [
        ((33333, 1202), (44444, 33333), 1202),
        ((33333, 1202), (44444, 1202), 1202),
        ((1202, 1203), (1203, 1202), 1203),
        ((1202, 1203), (40000, 50000), 1203),
    ],
)
def test_a_reply_comes_from_any_port_and_goes_to_any(
    asked: tuple[int, int], replied: tuple[int, int], port: int
) -> None:
    frames = [said(0, 1, ports=asked), said(3, 2, b"\1\0", replied), said(900, 6)]
    (row,), findings = told(tracked([batch_of(frames)]))
    assert ((row["port"], row["requests"], row["replies"], row["timeouts"]), findings) == ((port, 1, 1, 0), [])


@pytest.mark.parametrize(
    ("services", "outcomes", "olds", "codes"),
    [
        ("w1 w2 r", ["open", "open"], [b"\0", None], ["NV701"]),
        ("w1 w2 r r", ["open", "open"], [b"\0", None], []),
        ("w1 w1 r", ["confirmed"], [b"\0"], []),
        ("w1 r w2 r", ["confirmed", "confirmed"], [b"\0", b"1"], []),
        ("w1 w2", ["unanswered", "unanswered"], [b"\0", None], ["NV701"]),
        ("w1 w2 r r w3 r", ["open", "open", "confirmed"], [b"\0", None, None], []),
    ],
)
def test_another_value_with_the_same_key_is_another_write(
    services: str, outcomes: list[str], olds: list[bytes | None], codes: list[str]
) -> None:
    frames = [said(0, 1), said(1, 2, b"\0")]
    for at, one in enumerate(services.split(), 2):
        frames.append(said(at, 4) if one == "r" else said(at, 3, one[1:].encode()))
    frames.append(said(900, 6))
    for packets in (1, 2, len(frames)):
        state = tracked(cut(batch_of(frames), packets))
        assert [one["outcome"] for one in written(state)] == outcomes
        assert [one["old"] and one["old"]["data"] for one in written(state)] == olds
        assert sorted({code for code, *_ in told(state)[1]}) == codes
