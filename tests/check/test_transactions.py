"""Rules about requests and replies: each limit by short conversations, and what cannot be decided."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.check.checks.transactions import NO_PAIR, NO_REQUESTS, NONE_JUDGED, NOT_DUE, STILL_WAITING, UNHEARD
from nvscope.check.rules import read_rules, rules_of
from nvscope.check.run import checked
from nvscope.check.verdict import Judged, Verdict
from nvscope.definition.project import Project
from nvscope.errors import UsageError
from nvscope.simulate.scenario_file import load_scenario
from tests.check.requests import (
    BUSY,
    DONE,
    FAILED,
    HMI,
    PRESS,
    READ_X,
    REFUSED,
    SERVICE,
    VALUE,
    WRITE_X,
    asked,
    file,
    in_turn,
    of_frames,
    page,
    post,
    reply,
    sent,
)
from tests.check.scenario_captures import SCENARIOS
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import CLIENT, SERVER, Line
from tests.simulate.simulation import Simulation

FAIL, PASS, OPEN = Verdict.FAIL, Verdict.PASS, Verdict.INCONCLUSIVE
LATENCY = {"check": "transaction", "max_latency": "20ms"}
ERRORS = {"check": "transaction", "max_errors": "10%"}
UNANSWERED = {"check": "transaction", "max_unanswered": 0}


def polled(*took_ms: float | None, **how: Any) -> list[Frame]:
    """Return a request each second with its reply, and telegrams until long after the last of them."""
    frames = [asked(1000 * number, took, counter=number, **how) for number, took in enumerate(took_ms)]
    return in_turn(*frames, [sent(1000 * number + 900) for number in range(len(took_ms) + 1)])


def verdict(frames: Sequence[Frame], rule: dict[str, Any], **how: Any) -> tuple[Verdict, float | None, str]:
    """Return the verdict of a rule on a capture with one pair, its worst value and why."""
    (one,) = of_frames(frames, rule, **how)
    (judged,) = one.subjects
    return one.verdict, judged.worst, judged.reason


QUICK = [3.0] * 10


@pytest.mark.parametrize(
    ("frames", "rule", "expected", "worst"),
    [
        (polled(*QUICK), LATENCY, PASS, 0.003),
        (polled(*QUICK, 30), LATENCY, FAIL, 0.03),
        (polled(*QUICK, 30), LATENCY | {"percentile": 90}, PASS, 0.003),
        (polled(*QUICK, 30, 40), LATENCY | {"percentile": 90}, FAIL, 0.03),
        (polled(*QUICK, 20), LATENCY | {"percentile": 100}, PASS, 0.02),
        (polled(*QUICK, 20.000001), LATENCY | {"percentile": 100}, FAIL, 0.020000001),
        (polled(*QUICK), ERRORS, PASS, 0.0),
        (polled(*QUICK[1:], None), ERRORS, PASS, 0.1),
        (polled(*QUICK, None, None), ERRORS, FAIL, 1 / 6),
        (polled(*QUICK, answer=REFUSED), ERRORS, FAIL, 1.0),
        (polled(*QUICK, answer=REFUSED), ERRORS | {"max_errors": 10}, PASS, 10),
        (polled(*QUICK, answer=REFUSED), ERRORS | {"max_errors": 9}, FAIL, 10),
        (polled(*QUICK, answer=REFUSED), LATENCY, PASS, 0.003),
        (polled(*QUICK, answer=REFUSED), UNANSWERED, PASS, 0),
        (polled(*QUICK, answer=BUSY), ERRORS, PASS, 0.0),
        (polled(*QUICK, answer=BUSY), LATENCY, OPEN, None),
        (polled(*QUICK, None), UNANSWERED, FAIL, 1),
        (polled(*QUICK, None), UNANSWERED | {"max_unanswered": "9%"}, FAIL, 1 / 11),
        (polled(*QUICK, None), UNANSWERED | {"max_unanswered": "10%"}, PASS, 1 / 11),
    ],
)  # fmt: skip
def test_requests_of_the_parameter_manager(
    frames: list[Frame], rule: dict[str, Any], expected: Verdict, worst: float | None
) -> None:
    found, value, _ = verdict(frames, rule)
    assert found is expected
    assert value == (None if worst is None else pytest.approx(worst, rel=0.005))
    assert value is None or rule is not LATENCY or (value > 0.02) == (expected is FAIL)


def test_a_verdict_has_frames_and_figures() -> None:
    frames = polled(3, 30, 3, 40)
    (one,) = of_frames(frames, LATENCY)
    (judged,) = one.subjects
    places = [number for number, frame in enumerate(frames, 1) if frame.ts_ns % SECOND in (30_000_000, 40_000_000)]
    assert judged == Judged(
        FAIL, node=HMI, protocol="sdo", partner=PRESS, port=1202, reason="p99 of 4 replies, 2 slower than 20.0 ms",
        worst=judged.worst, limit=0.02, unit="s", count=2, first_ns=1_030_000_000, frames=tuple(places),
    )  # fmt: skip


def test_the_limit_that_is_broken_is_told_and_the_others_beside_it() -> None:
    frames = polled(3, 3, 3, None)
    both = {**LATENCY, "max_errors": "10%", "max_unanswered": "0%"}
    assert verdict(frames, both) == (
        FAIL, 0.25, "0 refused, 1 unanswered of 4 requests; 1 unanswered of 4 requests"
    )  # fmt: skip
    assert verdict(polled(*QUICK), both)[::2] == (PASS, "p99 of 10 replies")


def test_each_pair_is_judged_by_itself() -> None:
    others = [asked(1000 * number + 100, 30, counter=number, hmi=SERVICE) for number in range(5)]
    frames = in_turn(polled(*QUICK), *others, *(asked(1000 * one + 300, counter=one, port=1203) for one in range(3)))
    (one,) = of_frames(frames, LATENCY)
    told = [(each.node, each.port, each.verdict) for each in one.subjects]
    assert told == [(HMI, 1202, PASS), (HMI, 1203, PASS), (SERVICE, 1202, FAIL)]


@pytest.mark.parametrize(
    ("told", "nodes"),
    [
        ({"requester": HMI}, [HMI]), ({"client": HMI}, [HMI]), ({"requester": "10.0.0.*"}, [HMI, SERVICE]),
        ({"requester": ["10.0.0.2/31"]}, [SERVICE]), ({"requester": [HMI, SERVICE]}, [HMI, SERVICE]),
        ({"partner": PRESS}, [HMI, SERVICE]), ({"server": "10.0.0.0/24"}, [HMI, SERVICE]),
        ({"protocol": "sdo"}, [HMI, SERVICE]), ({"protocol": "sdo", "requester": SERVICE}, [SERVICE]),
    ],
)  # fmt: skip
def test_a_rule_is_for_the_pairs_that_it_names(told: dict[str, Any], nodes: list[str]) -> None:
    frames = in_turn(polled(*QUICK), *(asked(1000 * one + 100, counter=one, hmi=SERVICE) for one in range(5)))
    (one,) = of_frames(frames, LATENCY | told)
    assert [each.node for each in one.subjects] == nodes


@pytest.mark.parametrize(
    "told", [{"protocol": "visu"}, {"requester": PRESS}, {"partner": HMI}, {"server": "10.1.0.0/16"}]
)
def test_where_there_is_no_such_pair_it_is_not_decided(told: dict[str, Any]) -> None:
    assert verdict(polled(*QUICK), LATENCY | told) == (OPEN, None, NO_PAIR)
    assert verdict(polled(*QUICK), LATENCY | told | {"optional": True})[0] is PASS


def test_a_name_that_nobody_has_given_decides_nothing() -> None:
    found, _, reason = verdict(polled(*QUICK), LATENCY | {"requester": "hmi"})
    assert (found, reason) == (OPEN, "no node is called hmi")


def test_where_only_one_direction_was_captured_it_is_not_decided() -> None:
    requests = [frame for one in range(10) for frame in asked(1000 * one, None, counter=one)]
    later = sent(20_000, SERVICE)
    found, _, reason = verdict([*requests, later], ERRORS)
    assert (found, reason) == (
        OPEN, f"nothing that {PRESS} sent is in the capture: nobody knows whether it answered"
    )  # fmt: skip
    # One that sends its lists, and answers nothing, does not answer.
    assert verdict([*requests, sent(20_000)], ERRORS)[0] is FAIL
    replies = [asked(1000 * one, counter=one)[1] for one in range(10)]
    assert verdict([*replies, later], ERRORS)[::2] == (OPEN, NO_REQUESTS)


def test_where_others_are_not_heard_it_is_not_decided() -> None:
    """As on a socket of this machine, which gets what is sent to everybody."""
    assert verdict(polled(*QUICK), ERRORS, hears_answers=False)[::2] == (OPEN, UNHEARD)
    assert verdict([sent(0)], ERRORS, hears_answers=False)[::2] == (OPEN, UNHEARD)


def test_what_may_still_be_answered_when_the_capture_ends_is_not_judged() -> None:
    assert verdict([sent(0), *asked(10, None, counter=1)], ERRORS)[::2] == (OPEN, NOT_DUE)
    assert verdict([*polled(*QUICK), *asked(11_000, None, counter=99)], UNANSWERED)[:2] == (PASS, 0)


def test_what_the_capture_lost_may_have_been_the_replies() -> None:
    frames = polled(*QUICK, None)
    assert verdict(frames, UNANSWERED, drops=1)[::2] == (
        OPEN, "the capture itself lost 1 frame: it may have been replies"
    )  # fmt: skip
    assert verdict(polled(*QUICK, None, None), UNANSWERED, drops=1)[0] is FAIL
    assert verdict(polled(*QUICK, answer=REFUSED), ERRORS, drops=5)[0] is FAIL


def test_a_request_is_judged_by_when_it_was_asked() -> None:
    """Its reply, or its deadline, may come when it is so no more; and what was asked in the warm-up is not judged."""
    frames = in_turn(polled(*QUICK, None, *QUICK), sent(10_100))
    asks = next(number for number, frame in enumerate(frames, 1) if frame.ts_ns == 10 * SECOND)
    for sign, expected in (("<=", FAIL), ("<", PASS), (">=", FAIL), (">", PASS)):
        assert verdict(frames, UNANSWERED | {"when": f"frame.number {sign} {asks}"})[0] is expected
    for at_ns, expected in ((10 * SECOND, FAIL), (10 * SECOND + 1, PASS)):
        assert verdict(frames, UNANSWERED, warmup_ns=at_ns)[0] is expected
    none = ERRORS | {"requester": HMI, "when": "frame.number > 0 && nv.index == 99"}
    assert verdict(frames, none)[0] is OPEN
    assert verdict(frames, ERRORS, warmup_ns=20_900 * MILLISECOND)[::2] == (OPEN, NONE_JUDGED)


@pytest.mark.parametrize(
    ("told", "what"),
    [
        ({}, "max_latency, max_errors or max_unanswered"), ({"max_latency": "0s"}, "more than 0"),
        ({"max_errors": -1}, "0 or more"), ({"max_errors": 0.5}, "a share in percent"),
        ({"max_errors": "5"}, "a share in percent"), ({"max_errors": 0, "percentile": 0}, "out of range"),
        ({"max_errors": 0, "percentile": 101}, "out of range"), ({"max_errors": 0, "protocol": "http"}, "choices"),
        ({"max_errors": 0, "requester": "10.0.0.0/40"}, "is no network"), ({"max_errors": 0, "partner": []}, "no node"),
        ({"max_errors": 0, "list": 7}, "requests are about no list"), ({"max_error": 0}, "unknown key"),
        ({"max_errors": 0, "requester": ["*"] * 101}, "more than 100 patterns"),
    ],
)  # fmt: skip
def test_mistakes_are_told(told: dict[str, Any], what: str) -> None:
    with pytest.raises(UsageError) as found:
        of_frames(polled(3), {"check": "transaction", **told})
    assert any(what in str(one) for one in found.value.mistakes)  # type: ignore[attr-defined]


def line(*answers: bytes | None, body: bytes = READ_X, wait_ms: int = 5) -> Line:
    """Return a connection over which the same is asked again and again; at None it ends."""
    found = page()
    for one in answers:
        found.ask(post(body)).wait(wait_ms * MILLISECOND)
        if one is None:
            return found.close(False).close(True).segment(False)
        found.answer(one).wait(100 * MILLISECOND)
    return found


GOOD = [reply(VALUE)] * 9


@pytest.mark.parametrize(
    ("talk", "rule", "expected", "worst"),
    [
        (line(*GOOD), LATENCY, PASS, 0.006),
        (line(*GOOD, wait_ms=50), LATENCY, FAIL, 0.051),
        (line(*GOOD), ERRORS, PASS, 0.0),
        (line(*GOOD, None), ERRORS, PASS, 0.1),
        (line(*GOOD, None), UNANSWERED, FAIL, 1),
        (line(*GOOD, reply(b"no", 404)), UNANSWERED, PASS, 0),
        (line(*GOOD, reply(b"no", 404), reply(b"no", 500)), ERRORS, FAIL, 2 / 11),
        (line(reply(DONE), body=WRITE_X), ERRORS, PASS, 0.0),
        (line(reply(FAILED), body=WRITE_X), ERRORS, FAIL, 1.0),
    ],
)
def test_requests_of_pages(talk: Line, rule: dict[str, Any], expected: Verdict, worst: float) -> None:
    (one,) = of_frames(talk.frames, rule | {"protocol": "visu"})
    (judged,) = one.subjects
    assert (one.verdict, judged.node, judged.partner, judged.port) == (expected, CLIENT[0], SERVER[0], 80)
    assert judged.worst == pytest.approx(worst, rel=0.005)


def test_of_pages_too_both_directions_have_to_be_captured() -> None:
    talk = line(*GOOD, None)
    ports = {True: (50_000).to_bytes(2, "big") + (80).to_bytes(2, "big")}
    client = [frame for frame in talk.frames if ports[True] in frame.data[30:40]]
    assert len(client) < len(talk.frames)
    found, _, reason = verdict(client, UNANSWERED)
    assert found is OPEN
    assert f"nothing that {SERVER[0]} sent is in the capture" in reason
    asks = page().ask(post(READ_X))
    assert verdict(asks.frames, UNANSWERED)[::2] == (OPEN, STILL_WAITING)


def test_a_request_of_a_page_is_judged_by_when_it_was_asked() -> None:
    talk = line(*GOOD, None)
    (asks,) = of_frames(talk.frames, UNANSWERED)[0].subjects[0].frames
    for sign, expected in (("<=", FAIL), ("<", PASS), (">=", FAIL)):
        assert verdict(talk.frames, UNANSWERED | {"when": f"frame.number {sign} {asks}"})[0] is expected
    at_ns = talk.frames[asks - 1].ts_ns - talk.frames[0].ts_ns
    assert verdict(talk.frames, UNANSWERED, warmup_ns=at_ns)[0] is FAIL
    assert verdict(talk.frames, UNANSWERED, warmup_ns=at_ns + 1)[::2] == (OPEN, NONE_JUDGED)


@pytest.mark.parametrize("visu", [False, True])
def test_each_of_several_warm_ups_is_as_if_it_were_the_only_one(visu: bool, tmp_path: Path) -> None:
    frames = line(*GOOD, None).frames if visu else polled(*QUICK, None, 30, 3)
    capture, files, alone = file(frames, tmp_path / "x.pcap"), [], {}
    texts = (
        "max_latency = '1us'", "max_unanswered = 0", "max_errors = 0\nwhen = 'frame.number > 12'",
        "max_errors = 0\npercentile = 50",
    )  # fmt: skip
    writes = "[[rule]]\nid = '{0}w'\ncheck = 'writes'\nonly_by = '192.0.2.1'\n"
    patient = "[[rule]]\nid = '{0}a'\ncheck = 'acknowledged'\nwithin = '4s'\noptional = true\n"
    for name in ("0s", "500ms", "3s"):
        rules = "".join(f"[[rule]]\nid = '{name}{at}'\ncheck = 'transaction'\n{one}\n" for at, one in enumerate(texts))
        path = tmp_path / f"{name}.rules.toml"
        path.write_text(f"[defaults]\nwarmup = '{name}'\n{rules}{writes.format(name)}{patient.format(name)}")
        files.append(str(path))
        alone |= judged_in(capture, [str(path)])
    assert {FAIL, PASS} <= {one[0] for one in alone.values()}
    for order in (files, files[::-1]):
        assert judged_in(capture, order) == alone


def judged_in(capture: Path, files: list[str]) -> dict[str, tuple[Verdict, list[Judged]]]:
    """Return the verdict of each rule of files, with its subjects."""
    found = checked(Inquiry([str(capture)], Project()), read_rules(files))
    return {one.rule.id: (one.verdict, list(one.subjects)) for one in found.decided}


@pytest.mark.parametrize(
    ("name", "rule", "expected"),
    [
        ("parameter-manager", LATENCY, FAIL), ("parameter-manager", LATENCY | {"max_latency": "301ms"}, PASS),
        ("parameter-manager", UNANSWERED, FAIL), ("parameter-manager", UNANSWERED | {"max_unanswered": 3}, PASS),
        ("parameter-manager", ERRORS, PASS), ("parameter-manager", ERRORS | {"max_errors": "8%"}, FAIL),
        ("parameter-late", LATENCY, PASS), ("parameter-late", UNANSWERED, FAIL),
        ("parameter-refused", UNANSWERED, PASS), ("parameter-refused", ERRORS, FAIL),
        ("parameter-refused", ERRORS | {"max_errors": 3}, PASS), ("parameter-refused", LATENCY, PASS),
        ("plant-clean", LATENCY, OPEN),
    ],
)  # fmt: skip
def test_scenarios(name: str, rule: dict[str, Any], expected: Verdict, tmp_path: Path) -> None:
    inquiry = Simulation(load_scenario(SCENARIOS / f"{name}.toml")).inquiry(tmp_path)
    (one,) = checked(inquiry, rules_of([{"id": "x", **rule}], "test")).decided
    assert one.verdict is expected
