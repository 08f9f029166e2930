"""The load of CAN buses: by the arithmetic of canbusload, second by second and identifier by identifier."""

from __future__ import annotations

import random
import struct
from collections import defaultdict
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType
from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.frame import dissect_can
from nvscope.definition.buses import Buses, BusSettings
from nvscope.definition.limits import Limits
from nvscope.engine.reading import Reading
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests.dissectors.can.test_bits import classic_bits
from tests.laws import examples
from tests.oracle.frame import Frame as Packet
from tests.packets import batch_of, observed
from tests.packets import cut as cut_into
from tests.tracker.can.bus_traffic import bus_traffic
from tests.tracker.can.test_state import START_NS, Frame, batch, traffic

S = 1_000_000_000


def report(
    frames: list[Frame], given: Buses | None = None, cut: int = 1 << 17, limits: Limits | None = None
) -> dict[str, Any]:
    state, whole = TrackerState(), batch(frames)
    observed(state, cut_into(whole, cut))
    summary = summarize(state, buses=given)
    return report_document(summary, judge(state, summary=summary, limits=limits), [])


def at(rate: int, data: int | None = None, channel: str = "*") -> Buses:
    return Buses(((channel, BusSettings(rate, data)),))


def worst_bits(word: int, data: bytes) -> int:
    """The most bits that a frame of so much data can have: Davis and others (2007), what canbusload shows."""
    return (80 if word >> 31 else 55) + 10 * len(data)


@pytest.mark.parametrize("seed", range(6))
def test_load_is_that_of_canbusload(seed: int) -> None:
    """canbusload divides the bits of each second by the bit rate; ``-e`` is the exact mode, the default the worst."""
    choice = random.Random(seed)
    rate = choice.choice([50_000, 125_000, 500_000])
    frames = bus_traffic(rate, 0.3, 1500, seed=seed)
    exact, worst = defaultdict(int), defaultdict(int)
    for time_ns, _, word, data in frames:
        exact[time_ns // S] += classic_bits(word, data, len(data))
        worst[time_ns // S] += worst_bits(word, data)
    (bus,) = report(frames, at(rate))["buses"]
    load = bus["load"]
    peak = max(exact, key=lambda second: exact[second])
    assert (load["peak_ns"], bus["peak_bits"]) == (str(peak * S), exact[peak])
    assert int(load["peak"]) == exact[peak] * 100 // rate
    assert int(load["worst"]) == worst[peak] * 100 // rate
    assert [began_ns for began_ns, _, _ in load["by_second"]] == [str(second * S) for second in sorted(exact)]
    for began_ns, part, most in load["by_second"]:
        second = int(began_ns) // S
        assert (int(part), int(most)) == (exact[second] * 100 // rate, worst[second] * 100 // rate)
    seconds = max(1.0, (frames[-1][0] - frames[0][0]) / S)
    assert load["mean"] == pytest.approx(100 * sum(exact.values()) / rate / seconds, abs=0.001)
    by_word = defaultdict(int)
    for _, _, word, data in frames:
        by_word[word & 0x1FFF_FFFF, bool(word >> 31)] += classic_bits(word, data, len(data))
    assert {(one["cob_id"], one["extended"]): one["bits"] for one in bus["identifiers"]} == by_word
    assert [one["bits"] for one in bus["identifiers"]] == sorted(by_word.values(), reverse=True)


@examples(25)
@given(st.integers(0, 1000), st.sampled_from([1, 7, 64, 399]), st.booleans())
def test_any_cut_gives_the_same_buses(seed: int, cut: int, given_: bool) -> None:
    """Whatever is sent, and however it is read; the shares of a bus are those of all that was sent on it."""
    frames = traffic(seed)
    known = at(125_000) if given_ else None
    whole = report(frames, known)
    assert report(frames, known, cut) == whole
    for bus in whole["buses"]:
        assert sum(one["bits"] for one in bus["identifiers"]) == bus["bits"]
        assert sum(one["share"] for one in bus["identifiers"]) == pytest.approx(100, abs=0.1)
        assert sum(one["frames"] for one in bus["identifiers"]) <= bus["frames"]


def test_a_bit_rate_is_found_or_given_and_the_report_says_which() -> None:
    frames = bus_traffic(250_000, 0.5, 2000)
    assert report(frames)["buses"][0]["bit_rate"] == {"nominal": 250_000, "data": None, "source": "found"}
    assert report(frames, at(500_000))["buses"][0]["bit_rate"] == {"nominal": 500_000, "data": None, "source": "given"}
    quiet = report(frames[:10])["buses"][0]
    assert (quiet["bit_rate"], quiet["load"]) == (None, None)


def test_seconds_above_the_limit_are_one_finding() -> None:
    """About 113 bits a frame: 80 frames a second are 72 % of 12.5 kbit/s, 40 are 36 %."""
    frames: list[Frame] = []
    for second, number in enumerate([40, 80, 40, 80, 81, 10]):
        frames += [
            (START_NS + second * S + place * 10_000_000, 0, 0x555 - place % 2, b"\x55" * 8) for place in range(number)
        ]
    bits = {word: classic_bits(word, b"\x55" * 8, 8) for word in (0x555, 0x554)}
    (found,) = [one for one in report(frames, at(12_500))["findings"] if one["code"] == "NV605"]
    assert (found["count"], found["list"], found["frames"]) == (3, None, [])
    assert (found["first_ns"], found["last_ns"]) == (str(START_NS + S), str(START_NS + 5 * S))
    peak = 100 * (41 * bits[0x555] + 40 * bits[0x554]) / 12_500
    assert "3 seconds of 6 above 70 %; load 58.8 % in the mean, " in found["message"]
    assert f"{peak:.1f} % at the peak (87.5 % with all stuff bits there can be)" in found["message"]
    assert found["message"].startswith("Channel can0 at 12.5 kbit/s (given): ")
    assert found["message"].endswith("The largest shares: 0x554 50.3 %, 0x555 49.7 %.")
    raised = Limits(bus_load_percent=80)
    assert "NV605" not in [one["code"] for one in report(frames, at(12_500), limits=raised)["findings"]]


def test_the_data_phase_of_can_fd_has_its_own_bit_rate() -> None:
    raw = struct.pack(">IBBBB", 0x123, 64, 4 | 1, 0, 0) + bytes(range(64))
    packets = batch_of([Packet(START_NS + place * 10**7, LinkType.CAN_SOCKETCAN, raw, len(raw)) for place in range(50)])
    state = TrackerState()
    observed(state, [packets])
    bits = wire_bits(dissect_can(packets), Stuffing.EXACT)
    for data, partial in ((2_000_000, False), (None, True)):
        (bus,) = summarize(state, buses=at(500_000, data)).can.buses
        assert bus.load is not None
        seconds = bits.nominal.sum() / 500_000 + (bits.fast.sum() / data if data else 0)
        assert bus.load.peak == pytest.approx(100 * seconds)
        assert bus.load.partial == partial
        assert bus.fast_bits == bits.fast.sum()


@pytest.mark.parametrize("rate", [None, 125_000])
@pytest.mark.parametrize("most", [1, 2, 3])
def test_shares_are_those_of_the_whole_bus_however_few_identifiers_are_told_apart(rate: int | None, most: int) -> None:
    frames = bus_traffic(125_000, 0.3, 300, seed=1)
    shares = []
    for limit in (most, 10_000):
        state = TrackerState()
        observed(state, [batch(frames)], Reading(max_streams=limit))
        (bus,) = summarize(state, buses=at(rate) if rate else None).can.buses
        shares.append({(entry.cob_id, entry.extended): entry.share for entry in bus.identifiers})
    few, every = shares
    assert len(few) == most < len(every)
    assert few == pytest.approx({key: every[key] for key in few})
    assert sum(every.values()) == pytest.approx(100)
