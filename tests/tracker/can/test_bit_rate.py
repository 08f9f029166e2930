"""The bit rate of a bus found from frames that follow each other at once: right, or nothing."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.frame import dissect_can
from nvscope.tracker.can.bit_rate import USUAL_RATES, BackToBack
from tests.laws import examples
from tests.tracker.can.bus_traffic import bus_traffic
from tests.tracker.can.test_state import START_NS, Frame, batch


def found(frames: list[Frame], cut: int = 1 << 17, channel: int = 0) -> int | None:
    pairs, whole = BackToBack(), batch(frames)
    for begin in range(0, len(whole), cut):
        part = dissect_can(whole[begin : begin + cut])
        pairs.observe(part, wire_bits(part, Stuffing.EXACT).nominal)
    return pairs.rate(channel)


@pytest.mark.parametrize("stamped_at_start", [False, True])
@pytest.mark.parametrize("same_length", [False, True])
@pytest.mark.parametrize("rate", USUAL_RATES)
def test_every_usual_rate_is_found_at_a_usual_load(rate: int, same_length: bool, stamped_at_start: bool) -> None:
    frames = bus_traffic(rate, 0.35, 3000, same_length=same_length, stamped_at_start=stamped_at_start, quantum_ns=1000)
    assert found(frames) == rate


@pytest.mark.parametrize(("rate", "jitter_ns"), [(125_000, 12_000), (250_000, 6_000), (500_000, 3_000)])
def test_a_rate_is_found_through_the_jitter_of_a_computer(rate: int, jitter_ns: int) -> None:
    assert found(bus_traffic(rate, 0.5, 6000, jitter_ns=jitter_ns)) == rate


@examples(60)
@given(
    st.sampled_from(USUAL_RATES), st.floats(0.02, 0.95), st.sampled_from([0, 1_000, 20_000, 100_000, 1_000_000]),
    st.sampled_from([1, 1_000, 10_000, 100_000, 1_000_000]), st.booleans(), st.integers(0, 50),
)  # fmt: skip
def test_a_rate_that_is_found_is_the_right_one(
    rate: int, load: float, jitter_ns: int, quantum_ns: int, same_length: bool, seed: int
) -> None:
    """Whatever the load, the jitter and the resolution of the stamps."""
    frames = bus_traffic(
        rate, load, 1500, seed=seed, jitter_ns=jitter_ns, quantum_ns=quantum_ns, same_length=same_length
    )
    assert found(frames) in (rate, None)


@examples(60)
@given(st.floats(1e-4, 2e-2), st.floats(0, 0.3), st.booleans(), st.integers(0, 50))
def test_one_list_at_its_interval_is_no_bit_rate(cycle_s: float, jitter: float, random_data: bool, seed: int) -> None:
    """Frames of about 120 bits a millisecond are not 125 kbit/s, however regular they are."""
    choice, frames, now_s = random.Random(seed), [], 0.0
    for _ in range(1500):
        now_s += cycle_s * max(0.05, choice.gauss(1, jitter))
        data = choice.randbytes(8) if random_data else bytes(8)
        frames.append((START_NS + round(now_s * 1e9), 0, 0x181, data))
    assert found(frames) is None


@pytest.mark.parametrize("quantum_ns", [100_000, 1_000_000])
def test_coarse_stamps_tell_nothing(quantum_ns: int) -> None:
    assert found(bus_traffic(500_000, 0.6, 4000, quantum_ns=quantum_ns)) is None


def test_frames_that_a_queue_stamps_together_tell_nothing_wrong() -> None:
    """An adapter hands over what came in a millisecond, a few microseconds apart."""
    choice = random.Random(1)
    frames, last_ns = [], 0
    for time_ns, channel, word, data in bus_traffic(250_000, 0.6, 4000):
        last_ns = max(last_ns + choice.randrange(1_000, 9_000), (time_ns // 1_000_000 + 1) * 1_000_000)
        frames.append((last_ns, channel, word, data))
    assert found(frames) is None


@pytest.mark.parametrize("cut", [1, 17, 1000])
def test_any_cut_finds_the_same(cut: int) -> None:
    both = sorted(bus_traffic(500_000, 0.4, 700) + bus_traffic(125_000, 0.4, 700, channel=1, seed=1))
    whole, parts = BackToBack(), BackToBack()
    for pairs, size in ((whole, len(both)), (parts, cut)):
        for begin in range(0, len(both), size):
            part = dissect_can(batch(both[begin : begin + size]))
            pairs.observe(part, wire_bits(part, Stuffing.EXACT).nominal)
    for name in parts._columns.COLUMNS:
        assert (parts._columns.column(name) == whole._columns.column(name)).all(), name
    assert (whole.rate(0), whole.rate(1)) == (500_000, 125_000)


def test_error_frames_stand_between_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is measured across an error frame, and no more than so many frames are looked at."""
    frames = bus_traffic(500_000, 0.9, 600)
    errors = [(time_ns, 0, 0x2000_0004, bytes(8)) for time_ns, *_ in frames]
    assert found(frames) == 500_000
    assert found([frame for pair in zip(errors, frames, strict=True) for frame in pair]) is None
    monkeypatch.setattr("nvscope.tracker.can.bit_rate.MAX_PAIRS", 500)
    junk = [(START_NS - (1000 - place) * 1_000_000, 0, 0x181, b"") for place in range(500)]
    assert found(junk + frames) is None
    assert found(junk[:400] + frames, 7) == 500_000
