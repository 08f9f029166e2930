"""What acknowledgements tell of replies that were captured before their requests, and where requests are missing."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.laws import every_other, examples
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, PSH
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import DONE, HEAD, REFUSED
from tests.tracker.visu.test_endings import said

REPLIES = {"confirmed": DONE, "refused": REFUSED}


def write(number: int) -> bytes:
    return HEAD + b"|1|1|0|4|0|4|6|%03d|" % number


def became(frames: list[Frame]) -> list[str]:
    """Return what became of writes: by the rules, too, and the same however the frames are cut."""
    rules = by_the_rules(frames)
    for packets in every_other(1, 2, 3, len(frames)):
        state = followed(cut(batch_of(frames), packets))
        assert told(state)[1] == rules.findings()
        assert writes_of(state) == writes_by_the_rules(rules)
    return [one[8] for one in writes_of(state)]


def exchanges(line: Line, outcomes: list[str], first: int = 0) -> Line:
    """Write one after the other, each once the one before is answered."""
    for number, outcome in enumerate(outcomes, first):
        line.ask(write(number)).answer(REPLIES[outcome]).segment(True)
    return line


def swapped(frames: list[Frame], place: int) -> list[Frame]:
    """Return frames two of which were captured the other way round."""
    first, second = frames[place : place + 2]
    turned = [second._replace(ts_ns=first.ts_ns), first._replace(ts_ns=second.ts_ns)]
    return [*frames[:place], *turned, *frames[place + 2 :]]


OUTCOMES = ["confirmed", "refused", "confirmed", "confirmed", "refused", "confirmed"]


@pytest.mark.parametrize("opened", [True, False])
@pytest.mark.parametrize("exchange", range(6))
def test_a_reply_in_front_of_its_request_is_the_requests(opened: bool, exchange: int) -> None:
    line = exchanges(Line().open() if opened else Line(), OUTCOMES)
    place = (3 if opened else 0) + 3 * exchange
    assert became(swapped(line.frames, place)) == OUTCOMES


def test_so_it_is_where_the_server_is_always_heard_early() -> None:
    frames = exchanges(Line().open(), OUTCOMES).frames
    for exchange in range(6):
        frames = swapped(frames, 3 + 3 * exchange)
    assert became(frames) == OUTCOMES


def test_a_reply_to_what_was_not_captured_is_nobodys() -> None:
    line = exchanges(Line().open(), OUTCOMES[:2]).lose(True, 60).answer(REFUSED)
    assert became(exchanges(line, ["confirmed"] * 3, 2).frames) == [*OUTCOMES[:2], *["confirmed"] * 3]
    # Nor is it that of a request that was captured in front of it.
    line = exchanges(Line().open(), ["confirmed"])
    ahead = line.sent[True]
    line.segment(True, write(1)).segment(False, REFUSED, ack=ahead).lose(False, len(REFUSED))
    assert became(line.lose(True, len(write(1))).answer(DONE).frames) == ["confirmed", "confirmed"]


def test_where_acknowledgements_say_nothing_the_first_that_waits_is_answered() -> None:
    for flags in (ACK, PSH):
        line = Line()
        for number, outcome in enumerate(OUTCOMES):
            line.segment(True, write(number), flags, ack=0).lose(True, len(write(number)))
            line.segment(False, REPLIES[outcome], flags, ack=0).lose(False, len(REPLIES[outcome]))
        assert became(line.frames) == OUTCOMES


@pytest.mark.parametrize("turned", [True, False])
def test_a_first_reply_of_which_a_part_is_missing_is_not_made_up_of_the_next(turned: bool) -> None:
    line = Line().ask(write(0)).answer(DONE[:20]).answer(DONE[20:])
    exchanges(line, OUTCOMES, 1)
    frames = swapped(line.frames, 1) if turned else [line.frames[0], *line.frames[2:]]
    assert became(frames) == ["open", *OUTCOMES]
    assert "nobody knows what answers frame 1" in said(frames)


@pytest.mark.parametrize("hidden", [1, 2])
def test_behind_requests_that_are_missing_nobody_knows_what_answers_those_sent_with_them(hidden: int) -> None:
    line = exchanges(Line().open(), ["confirmed"])
    line.lose(True, hidden * len(write(1))).ask(write(2)).ask(write(3))
    for outcome in ["refused"] * hidden + ["confirmed", "confirmed"]:
        line.answer(REPLIES[outcome]).segment(True)
    assert became(exchanges(line, OUTCOMES, 4).frames) == ["confirmed", "open", "open", *OUTCOMES]


def test_nor_where_the_first_of_them_was_captured() -> None:
    line = Line().open().ask(write(0)).lose(True, len(write(1))).ask(write(2))
    for outcome in ("refused", "refused", "confirmed"):
        line.answer(REPLIES[outcome]).segment(True)
    found = became(exchanges(line, OUTCOMES, 3).frames)
    assert found[1:] == ["open", *OUTCOMES]


def test_of_who_asks_more_before_it_has_all_replies_nobody_knows_again() -> None:
    line = Line().open().ask(write(0)).ask(write(1)).answer(DONE).ask(write(2)).answer(REFUSED).answer(DONE)
    line.ask(write(3)).answer(DONE).lose(True, 60).answer(DONE).ask(write(4)).answer(DONE)
    assert became(line.frames) == ["confirmed", "refused", "confirmed", "confirmed", "open"]


@examples(150)
@given(seed=st.integers(0, 10**6))
def test_who_waits_for_replies_is_in_step_behind_whatever_is_missing(seed: int) -> None:
    rng = random.Random(seed)
    outcomes = [rng.choice(list(REPLIES)) for _ in range(12)]
    if rng.random() < 0.7:
        line = Line().open()
    else:
        line, outcomes[0] = Line(), "confirmed"
    first = len(line.frames)
    frames = exchanges(line, outcomes).frames
    lost = set(rng.sample(range(first + 3, len(frames) - 9), rng.randint(1, 3)))
    kept = [one for place, one in enumerate(frames) if place not in lost]
    found = dict(zip([one[7] for one in writes_of(followed([batch_of(kept)]))], became(kept), strict=True))
    for number, outcome in enumerate(outcomes):
        assert found.get(f"{number:03}", "open") in ("open", outcome)
    # The last two are behind all that is missing, and behind one that is whole.
    assert [found["010"], found["011"]] == outcomes[10:]
    assert "nobody" not in " ".join(said(kept))


@examples(150)
@given(seed=st.integers(0, 10**6))
def test_nothing_is_ever_said_to_be_what_it_was_not(seed: int) -> None:
    """Several are sent at once, in segments of any size, and segments are captured the other way round."""
    rng = random.Random(seed)
    line = Line().open()
    truth: dict[str, str] = {}
    number = 0
    while number < 10:
        together = rng.choice((1, 1, 2, 3))
        own = {f"{number + more:03}": rng.choice(list(REPLIES)) for more in range(together)}
        say(rng, line, True, b"".join(write(number + more) for more in range(together)))
        for outcome in own.values():
            say(rng, line, False, REPLIES[outcome])
            line.segment(True)
        truth |= own
        number += together
    frames = line.frames
    for _ in range(rng.randint(1, 4)):
        frames = swapped(frames, rng.randrange(3, len(frames) - 1))
    found = zip([one[7] for one in writes_of(followed([batch_of(frames)]))], became(frames), strict=True)
    assert all(outcome in ("open", truth[value]) for value, outcome in found)


def say(rng: random.Random, line: Line, side: bool, data: bytes) -> None:
    while data:
        size = rng.choice((len(data), rng.randint(1, len(data))))
        line.say(side, data[:size])
        data = data[size:]
