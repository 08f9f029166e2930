"""Error frames and bus-off by channel, against following them frame by frame."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.findings.judge import judge
from nvscope.tracker.can.errors import BusErrors, CanErrors
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from tests.laws import examples
from tests.packets import Batches, observed
from tests.packets import cut as pieces_of
from tests.tracker.can.test_state import START_NS, Frame, batch

S = 1_000_000_000
BUS_OFF, RESTARTED, CONTROLLER, COUNTERS, PROTOCOL = (0x2000_0000 | bit for bit in (0x40, 0x100, 0x4, 0x200, 0x8))


def errors_of(frames: list[Frame], cut: int = 1 << 17) -> dict[int, BusErrors]:
    errors, whole = CanErrors(), batch(frames)
    for told in run(Batches(pieces_of(whole, cut)), Reading(), []):
        if told.can is not None:
            errors.observe(told, told.can)
    return errors.by_channel()


def followed(frames: list[Frame], channel: int) -> dict[str, Any]:
    """Follow a channel frame by frame."""
    off_ns, bus_offs, restarts, returns, since = [], 0, 0, 0, None
    count, tx, rx = 0, None, None
    for time_ns, on, word, data in frames:
        if on != channel:
            continue
        error = bool(word & 0x2000_0000)
        detail = data.ljust(8, b"\0")
        if error:
            count += 1
            if word & 0x200 or (word & 0x4 and (detail[6] or detail[7])):
                tx, rx = max(tx or 0, detail[6]), max(rx or 0, detail[7])
        if error and word & 0x40:
            if since is None:
                since, bus_offs = time_ns, bus_offs + 1
        elif since is not None and (not error or word & 0x100 or (word & 0x4 and detail[1] & 0x40)):
            off_ns.append(time_ns - since)
            restarts, returns, since = restarts + error, returns + (not error), None
    return {
        "count": count, "bus_offs": bus_offs, "restarts": restarts, "returns": returns, "off_ns": sum(off_ns),
        "longest_off_ns": max(off_ns, default=0), "off_since_ns": since, "tx_errors": tx, "rx_errors": rx,
    }  # fmt: skip


def troubled(seed: int, count: int) -> list[Frame]:
    choice = random.Random(seed)
    time_ns, frames = START_NS, []
    words = [0x181, 0x181, BUS_OFF, BUS_OFF, RESTARTED, CONTROLLER, COUNTERS, PROTOCOL, BUS_OFF | 0x4, 0x2000_0004]
    for _ in range(count):
        time_ns += choice.randrange(1, 50_000_000)
        word = choice.choice(words)
        data = bytes(
            [0, choice.choice([0, 0x40, 0x10, 0x04]), 0, 0, 0, 0, choice.randrange(256), choice.randrange(256)]
        )
        frames.append((time_ns, choice.randrange(2), word, data))
    return frames


@examples(60)
@given(st.integers(0, 10_000), st.integers(1, 200), st.sampled_from([1, 3, 50, 200]))
def test_errors_are_those_found_frame_by_frame_whatever_the_cut(seed: int, count: int, cut: int) -> None:
    frames = troubled(seed, count)
    found = errors_of(frames, cut)
    assert found == errors_of(frames)
    for channel in (0, 1):
        expected = followed(frames, channel)
        if channel not in found:
            assert expected["count"] == 0
            continue
        assert {name: getattr(found[channel], name) for name in expected} == expected


def findings(frames: list[Frame]) -> list[Any]:
    state = TrackerState()
    observed(state, [batch(frames)])
    return [one for one in judge(state, summary=summarize(state)) if one.code == "NV606"]


def test_a_bus_that_fails_twice_and_stays_off() -> None:
    """Off after one second, restarted after 0.5 s; off again, back by a frame after 2 s; then off until the end."""
    frames = [
        (START_NS, 0, 0x181, bytes(8)),
        (START_NS + S, 0, CONTROLLER, b"\0\x20" + bytes(4) + b"\x80\x60"),
        (START_NS + S, 0, BUS_OFF, bytes(8)),
        (START_NS + S * 3 // 2, 0, RESTARTED, bytes(8)),
        (START_NS + 2 * S, 0, BUS_OFF, bytes(8)),
        (START_NS + 4 * S, 0, 0x181, bytes(8)),
        (START_NS + 5 * S, 0, BUS_OFF, bytes(8)),
        (START_NS + 6 * S, 0, BUS_OFF, bytes(8)),
        (START_NS + 8 * S, 1, 0x181, bytes(8)),
    ]
    (found,) = findings(frames)
    assert found.message == (
        "Channel can0: error frames, by what they tell: controller problem (1), bus off (4), controller restarted (1). "
        "It was off the bus 3 times, for 2.5 s in all, 2.0 s at the longest, and for the last 3.0 s. "
        "The controller told: error passive by transmit errors (1). "
        "Its error counters went up to 128 (transmit) and 96 (receive)."
    )
    assert (found.count, found.frames) == (6, (2, 3, 4, 5, 7, 8))
    assert (found.first_ns, found.last_ns) == (START_NS + S, START_NS + 6 * S)


@pytest.mark.parametrize("word", [0x2000_0000, 0x2000_0400])
def test_an_error_frame_of_no_known_class_is_one_all_the_same(word: int) -> None:
    (found,) = findings([(START_NS, 0, word, bytes(8))] * 3)
    assert found.message == "Channel can0: error frames, by what they tell: class not recorded (3)."
    assert found.count == 3


def test_a_flood_of_channels_is_no_burden() -> None:
    frames = [(START_NS + place, place, BUS_OFF, bytes(8)) for place in range(3000)]
    found = errors_of(frames, 700)
    assert len(found) == 3000
    assert np.unique([errors.bus_offs for errors in found.values()]).tolist() == [1]
