"""Requests and replies paired at once around what is peculiar, against the same message by message."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

import nvscope.tracker.visu.pairing
from tests.laws import examples
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.capture_faults import Faults, captured
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import followed, told, writes_of

ASKED = [
    b"|0|1|0|4|146|2|1|", b"|0|2|0|4|146|2|1|1|4|148|2|1|", b"|1|1|0|4|146|2|1|7|",
]  # fmt: skip
ANSWERED = [b"|7|", b"|7|8|", b"|0|", b"|1|"]


@examples(40)
@given(seed=st.integers(0, 20_000), packets=st.sampled_from([100, 700, 5000]))
def test_what_is_paired_at_once_is_what_is_paired_in_turn(seed: int, packets: int) -> None:
    batch = batch_of(polled(seed))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(nvscope.tracker.visu.pairing, "_FEW", 1 << 40)
        # Of so few packets, no message is seen to come again and again either.
        in_turn = followed(cut(batch, 20))
        patched.setattr(nvscope.tracker.visu.pairing, "_FEW", 4)
        at_once = followed(cut(batch, packets))
    assert told(at_once) == told(in_turn)
    assert writes_of(at_once) == writes_of(in_turn)


def polled(seed: int) -> list[Frame]:
    """Return the frames of pages that poll over connections that stay, some of which are missing, late or cut."""
    rng = random.Random(seed)
    frames: list[Frame] = []
    for number in range(rng.randint(1, 3)):
        line = Line(("10.0.0.1", 50_000 + number), now=number * rng.randrange(SECOND))
        faults = Faults.drawn(rng)
        asked = rng.choice((ASKED, ASKED[:1], ASKED[1:2]))
        surplus, silent, together = (rng.choice((0, 0, 0.01, 0.1)) for _ in range(3))
        for _ in range(rng.choice((30, 250))):
            count = rng.randint(2, 4) if rng.random() < together else 1
            for body in [rng.choice(asked) for _ in range(count)]:
                say(rng, line, True, b"POST /webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%b" % (len(body), body))
            line.wait(rng.choice((1, 5)) * MILLISECOND)
            for body in [rng.choice(ANSWERED) for _ in range(count + (rng.random() < surplus))]:
                if rng.random() >= silent:
                    say(rng, line, False, b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%b" % (len(body), body))
        frames += captured(rng, faults, line)
    return sorted(frames, key=lambda frame: frame.ts_ns)


def say(rng: random.Random, line: Line, from_client: bool, data: bytes) -> None:
    """Say something in one segment or two."""
    middle = rng.randrange(1, len(data)) if rng.random() < 0.2 else len(data)
    for part in (data[:middle], data[middle:]):
        if part:
            line.say(from_client, part)
