"""Servers of which nothing is heard before a connection has ended: by another clock, theirs come behind all of it."""

from __future__ import annotations

import random

import pytest

from tests.laws import some
from tests.oracle.tcp import ACK, RST, SYN
from tests.oracle.tcp_line import Line
from tests.packets import batch_of
from tests.tracker.visu.drawn_losses import OVERLAPPING, captured
from tests.tracker.visu.followed import followed, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, OTHER
from tests.tracker.visu.test_open_requests import became
from tests.tracker.visu.test_two_clocks import check, shifted

RESET_IN_FRONT_OF_ALL_REPLIES = (231595497, 814803997, 471592882)
"""By another clock, all that a server says lies behind the reset of its client, which had been answered."""

PASSED_BY = 614880292
"""All that a server says lies in front of its client: more responses than are kept, one of them to the last write."""


@pytest.mark.parametrize(
    ("hole", "replies", "outcomes"),
    [
        (0, (0, 0), ["unanswered", "unanswered"]), (0, (1, 0), ["open", "unanswered"]), (0, (1, 1), ["open", "open"]),
        (40, (1, 0), ["open", "unanswered"]), (40, (1, 1), ["open", "open"]),
    ],
)  # fmt: skip
def test_what_is_acknowledged_may_have_answered_what_was_asked_with_less(
    hole: int, replies: tuple[int, int], outcomes: list[str]
) -> None:  # fmt: skip
    """In front of the requests of a client that resets its connection, so many bytes of it are missing."""
    line = Line()
    line.segment(True, flags=SYN, seq=line.begin[True] - 1, ack=0).segment(True).lose(True, hole)
    for request, count in zip((HEAD + BODY, HEAD + OTHER), replies, strict=True):
        line.ask(request).lose(False, count * len(DONE))
    assert [outcome for _, outcome in became(line.reset(True).frames)] == outcomes


@pytest.mark.parametrize(("more", "outcome"), [(0, "unanswered"), (1, "unanswered"), (2, "open"), (60, "open")])
def test_one_byte_more_may_be_the_end_of_its_server(more: int, outcome: str) -> None:
    line = Line()
    line.segment(True, flags=SYN, seq=line.begin[True] - 1, ack=0).lose(True, 30).lose(False, 40)
    line.ask(HEAD + OTHER).segment(True, flags=RST | ACK, ack=line.sent[False] + more)
    assert became(line.frames) == [("8.5", outcome)]


@pytest.mark.parametrize("seed", [*some(range(40)), *RESET_IN_FRONT_OF_ALL_REPLIES, PASSED_BY])
def test_no_write_that_was_answered_is_told_as_unanswered(seed: int) -> None:
    frames, statuses = captured(seed, OVERLAPPING)
    frames = shifted(frames, random.Random(seed))
    check(frames, seed)
    state = followed([batch_of(frames)])
    for *_, value, outcome, _, _ in writes_of(state):
        assert outcome != "unanswered" or statuses[value] is None
