"""Captures by two clocks, or with frames that changed places, against the rules written frame by frame."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

import pytest

from tests.laws import some
from tests.oracle.builders import MILLISECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import peel_tcp
from tests.oracle.tcp_line import Line
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import batch_of, cut
from tests.tracker.visu.drawn_losses import OVERLAPPING, captured
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, GO_ON, HEAD, OTHER
from tests.tracker.visu.test_open_requests import became
from tests.tracker.visu.test_rules import expected, later, near

Change = Callable[[Sequence[Frame], random.Random], list[Frame]]

A_REPLY_THAT_IS_MISSED_IN_FRONT_OF_A_LATE_SYN = 693632492
"""The client acknowledges a reply before the server's SYN comes, and asks with HEAD."""

CODED_IN_FRONT_OF_OTHERS = 150213217
"""Behind missing bytes and an empty line, a request is coded in a way that nobody knows."""

LEFT_WITH_MORE_THAN_IS_THERE = 814379866
"""A client that closed its side acknowledges bytes that are not there, and waits for them in vain."""

TOLD_AGAIN = (20427193, 120126964, 836846392, 695083008, 845074892, 244924392)
"""A second segment acknowledges what the first one waited for in vain, in a batch of many segments."""

SHIFTED = (
    A_REPLY_THAT_IS_MISSED_IN_FRONT_OF_A_LATE_SYN, CODED_IN_FRONT_OF_OTHERS, LEFT_WITH_MORE_THAN_IS_THERE,
    *TOLD_AGAIN,
)  # fmt: skip

A_REPLY_TO_WHAT_HAD_BEGUN_THAT_IS_NONE = 584078228
"""A reply came before its request was whole, as it seemed; more is missing behind it."""


AHEAD = (901660086, 724536008, 8551995)
"""In each of these, frames changed places, and a reply was taken for that to a request which its client sent ahead."""


def shifted(frames: Sequence[Frame], rng: random.Random) -> list[Frame]:
    """Return frames of which those of the servers are by a clock that is ahead or behind."""
    away = rng.choice((-1, 1)) * rng.choice((10**5, MILLISECOND, 5 * MILLISECOND, 30 * MILLISECOND, 300 * MILLISECOND))

    def timed(frame: Frame) -> Frame:
        segment = peel_tcp(frame)
        by_server = segment is not None and segment.source_port in (80, 8080)
        return frame._replace(ts_ns=frame.ts_ns + away) if by_server else frame

    return sorted(map(timed, frames), key=lambda frame: frame.ts_ns)


def swapped(frames: Sequence[Frame], rng: random.Random) -> list[Frame]:
    """Return frames that have changed places with some near to them."""
    far = rng.choice((1.5, 3, 6))
    order = sorted(range(len(frames)), key=lambda place: place + rng.random() * far)
    return [frames[one]._replace(ts_ns=frames[place].ts_ns) for place, one in enumerate(order)]


def check(frames: list[Frame], seed: int) -> None:
    """Check that what is told of frames is what the rules say, however they are cut."""
    rules = by_the_rules(frames)
    rows = [near(row) for row in rules.rows()]
    for packets in (max(len(frames), 1), 1 + seed % 7):
        state = followed(cut(batch_of(frames), packets))
        found, findings = told(state)
        assert (found, writes_of(state)) == (rows, writes_by_the_rules(rules))
        assert findings == expected(findings, rules, frames)


@pytest.mark.parametrize("seed", [*some(range(60)), *SHIFTED])
def test_by_two_clocks_it_is_what_the_rules_say(seed: int) -> None:
    check(shifted(visu_traffic(seed), random.Random(seed)), seed)


@pytest.mark.parametrize("seed", some(range(40)))
def test_so_it_is_of_frames_that_changed_places(seed: int) -> None:
    check(swapped(visu_traffic(seed), random.Random(seed)), seed)


@pytest.mark.parametrize("change", [shifted, swapped])
@pytest.mark.parametrize("seed", [*some(range(40)), A_REPLY_TO_WHAT_HAD_BEGUN_THAT_IS_NONE])
def test_no_reply_is_taken_for_another_one(seed: int, change: Change) -> None:
    frames, statuses = captured(seed)
    frames = change(frames, random.Random(seed))
    check(frames, seed)
    have_become(frames, statuses)


@pytest.mark.parametrize("seed", AHEAD)
def test_nor_is_it_where_more_is_asked_before_all_is_answered(seed: int) -> None:
    frames, statuses = captured(seed, OVERLAPPING)
    frames = swapped(frames, random.Random(seed))
    check(frames, seed)
    have_become(frames, statuses)


def have_become(frames: list[Frame], statuses: dict[str, int | None]) -> None:
    """Check that of each write nothing is told, or with which status it was answered."""
    for *_, value, outcome, _, status in writes_of(followed([batch_of(frames)])):
        assert outcome == "open" or statuses[value] == status


def test_what_the_client_had_before_it_asked_is_no_reply_though_it_is_missing() -> None:
    line = Line().open().lose(False, 40).ask(HEAD).answer(GO_ON).ask(BODY).answer(DONE)
    assert became(line.frames) == [("9.5", "confirmed")]
    check(line.frames, 0)
    missing = Line().open().ask(HEAD).lose(False, 40).ask(BODY).answer(GO_ON)
    assert became(missing.frames) == [("9.5", "open")]
    check(missing.frames, 0)


def test_who_left_and_acknowledges_what_is_not_there_may_have_got_a_reply() -> None:
    line = Line().open().ask(HEAD + BODY)
    line.segment(True, ack=line.sent[False] + len(DONE)).answer(DONE)
    line.ask(HEAD + OTHER).close(True)
    unanswered = later(line.frames)
    assert became(unanswered) == [("9.5", "confirmed"), ("8.5", "unanswered")]
    answered = later(line.segment(True, ack=line.sent[False] + len(DONE)).frames)
    assert became(answered) == [("9.5", "confirmed"), ("8.5", "open")]
    for frames in (unanswered, answered):
        for seed in range(3):
            check(frames, seed)
