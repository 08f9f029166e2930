"""CAN frames tracked: against counting them one by one, whatever the cut."""

from __future__ import annotations

import random
import struct
import tracemalloc
from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dissectors.batch import LinkType, PacketBatch
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition
from nvscope.definition.pdos import Pdos
from nvscope.engine.reading import Reading
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.tracker.variables.values import Values
from nvscope.view.documents.report import report_document
from tests.definition.lists import INT, LREAL, list_of, telegram
from tests.laws import crossed
from tests.packets import batch_of, observed
from tests.packets import cut as cut_into
from tests.records import replace

START_NS = 1_700_000_000_000_000_000
Frame = tuple[int, int, int, bytes]  # time in ns, channel, identifier word, data


def batch(frames: list[Frame]) -> PacketBatch:
    parts = [struct.pack(">IBBBB", word, len(data), 0, 0, 0) + data for _, _, word, data in frames]
    sizes = np.array([len(part) for part in parts], np.int64)
    return PacketBatch(
        np.frombuffer(b"".join(parts) + bytes(128), np.uint8),
        np.cumsum(sizes) - sizes,
        sizes.astype(np.int32),
        sizes,
        np.array([frame[0] for frame in frames], np.int64),
        PacketBatch.link_column(LinkType.CAN_SOCKETCAN, len(frames)),
        np.array([frame[1] for frame in frames], np.uint16),
    )


def traffic(seed: int, count: int = 400) -> list[Frame]:
    """Return frames of two channels: data of standard and extended identifiers, remote frames, errors."""
    choice = random.Random(seed)
    time_ns, frames = START_NS, []
    for _ in range(count):
        time_ns += choice.choice([100_000, 1_000_000, 50_000_000])
        word = choice.choice([0x181, 0x182, 0x182, 0x8000_0181, 0x4000_0181, 0x2000_0004, 0x701])
        data = b"" if word & 0x4000_0000 else bytes(choice.choice([8, 8, 8, 4]))
        frames.append((time_ns, choice.randrange(2), word, data))
    return frames


def report(frames: list[Frame], cut: int, definition: Definition | None = None) -> dict[str, Any]:
    """Return the report on frames of can0 and vcan1, observed so many at a time."""
    definition = definition or Definition()
    values = Values(Layouts(definition), wanted=False) if definition.lists else None
    state = TrackerState(values=values)
    whole = batch(frames)
    observed(state, cut_into(whole, cut), Reading(pdos=Pdos(definition).rules()), ["can0", "vcan1"])
    summary = summarize(state, intervals_ns=definition.nominal_intervals_ns())
    return report_document(summary, judge(state, summary=summary, definition=definition), [], definition)


@pytest.mark.parametrize("seed", range(12))
def test_identifiers_are_counted_as_they_come(seed: int) -> None:
    frames = traffic(seed)
    found = report(frames, len(frames))
    data = defaultdict(list)
    for number, (time_ns, channel, word, payload) in enumerate(frames, 1):
        if not word & 0x6000_0000:
            data[["can0", "vcan1"][channel], word].append((number, time_ns, len(payload)))
    assert found["capture"]["can_frames"] == len(frames)
    lists = {(entry["channel"], entry["id"], entry["streams"][0]["extended"]): entry for entry in found["lists"]}
    assert set(lists) == {(channel, word & 0x1FFF_FFFF, bool(word >> 31)) for channel, word in data}
    changes = {
        (finding["list"], finding["count"], tuple(finding["frames"]))
        for finding in found["findings"]
        if finding["code"] == "NV603"
    }
    expected = set()
    for (channel, word), sent in data.items():
        entry = lists[channel, word & 0x1FFF_FFFF, bool(word >> 31)]
        (stream,) = entry["streams"]
        times = [time_ns for _, time_ns, _ in sent]
        assert (stream["telegrams"], entry["diag"]["tLastSend"]) == (len(sent), str(times[-1]))
        assert stream["length"] == sent[-1][2]
        assert stream["interval_ns"]["count"] == len(sent) - 1
        assert stream["interval_ns"]["max"] == max(b - a for a, b in pairwise(times))
        changed = [now[0] for before, now in pairwise(sent) if before[2] != now[2]]
        if changed:
            expected.add((entry["key"], len(changed), tuple(changed[:10])))
    assert changes == expected


@pytest.mark.parametrize(("cut", "seed"), crossed([1, 7, 64], range(4)))
def test_any_cut_gives_the_same_report(seed: int, cut: int) -> None:
    frames = traffic(seed)
    assert report(frames, cut) == report(frames, len(frames))


def test_error_frames_are_told_by_channel_and_class() -> None:
    frames = [
        (START_NS, 0, 0x181, bytes(8)),
        (START_NS + 1, 0, 0x2000_0040, bytes(8)),
        (START_NS + 2, 0, 0x2000_0104, b"\0\x40" + bytes(6)),
        (START_NS + 3, 1, 0x2000_0020, bytes(8)),
    ]
    messages = [one["message"] for one in report(frames, 4)["findings"] if one["code"] == "NV606"]
    assert messages == [
        "Channel can0: error frames, by what they tell: controller problem (1), bus off (1), controller restarted (1). "
        "It was off the bus 1 time, for 1 ns. The controller told: error active again (1).",
        "Channel vcan1: error frames, by what they tell: no acknowledgement on transmission (1).",
    ]


def test_the_bits_of_a_bus_are_those_of_its_frames_by_second() -> None:
    """A standard frame of 8 bytes of 0x55 needs no stuff bit in its data: 111 bits and those of head and CRC."""
    frames = [(START_NS + number * 100_000_000, 0, 0x555, b"\x55" * 8) for number in range(15)]
    (bus,) = report(frames, 4)["buses"]
    assert (bus["channel"], bus["frames"], bus["seconds"]) == ("can0", 15, 2)
    assert bus["bits"] % 15 == 0
    assert bus["peak_bits"] == bus["bits"] // 15 * 10
    assert bus["worst_bits"] == 135 * 10
    assert 111 * 15 <= bus["bits"] <= 135 * 15


def test_frames_of_a_defined_list_are_one_list_and_have_its_lengths() -> None:
    """LREAL fills the first frame; two INTs are in the second, which once comes too short."""
    definition = Definition((replace(list_of([LREAL, INT, INT], list_id=0x190), protocol="CAN", name="press"),))
    sizes = {0x190: [8, 8, 8], 0x191: [4, 2, 4], 0x192: [1, 1, 1]}
    frames = [
        (START_NS + number * 10_000_000 + place, 0, cob_id, bytes(sent[number]))
        for number in range(3)
        for place, (cob_id, sent) in enumerate(sizes.items())
    ]
    found = report(frames, 4, definition)
    assert [(entry["key"], entry["name"]) for entry in found["lists"]] == [
        ("can/can0/400", "press"), ("can/can0/402", None),
    ]  # fmt: skip
    assert [(s["cob_id"], s["subindex"]) for s in found["lists"][0]["streams"]] == [(0x190, 0), (0x191, 1)]
    (mismatch,) = [one for one in found["findings"] if one["code"] == "NV603"]
    assert (mismatch["list"], mismatch["subindex"], mismatch["count"]) == ("can/can0/400", 1, 1)
    assert mismatch["frames"] == [5]
    assert "1 frame of 3 has 2 bytes, not the 4 that the definition has" in mismatch["message"]


def cyclic(period_ns: int, frames: int, cob_ids: Sequence[int], size: int = 8) -> list[Frame]:
    """Return sendings of a list: its frames 200 µs apart."""
    return [
        (START_NS + number * period_ns + place * 200_000, 0, cob_id, bytes(size))
        for number in range(frames)
        for place, cob_id in enumerate(cob_ids)
    ]


def three_frames(**settings: Any) -> Definition:
    return Definition(
        (replace(list_of([LREAL, LREAL, LREAL], list_id=0x680), protocol="CAN", name="press", **settings),)
    )


def codes(found: dict[str, Any]) -> list[tuple[str, str | None, int | None, int]]:
    return [(one["code"], one["list"], one["subindex"], one["count"]) for one in found["findings"]]


@pytest.mark.parametrize("cut", [3, 50, 1000])
def test_a_cycle_without_one_of_its_frames_is_incomplete(cut: int) -> None:
    frames = cyclic(10_000_000, 40, (0x680, 0x681, 0x682))
    missing = {(20, 0x681), (25, 0x680), (30, 0x682), (31, 0x682)}
    left = [
        frame for place, frame in enumerate(frames) if (place // 3, frame[2]) not in missing
    ]  # fmt: skip
    found = report(left, cut, three_frames(interval_ns=10_000_000))
    assert ("NV604", "can/can0/1664", None, 4) in codes(found)
    assert report(frames, cut, three_frames(interval_ns=10_000_000))["findings"] == []


def test_frames_that_are_never_seen_make_every_cycle_incomplete() -> None:
    definition = three_frames(interval_ns=10_000_000)
    (two,) = report(cyclic(10_000_000, 20, (0x680, 0x682)), 1000, definition)["findings"]
    assert two["code"] == "NV604"
    assert "Never seen: 0x681." in two["message"]
    (one,) = report(cyclic(10_000_000, 20, (0x680,)), 1000, definition)["findings"]
    assert (one["code"], one["count"]) == ("NV604", 19)  # the last cycle is not over
    assert "Never seen: 0x681, 0x682." in one["message"]


@pytest.mark.parametrize("cut", [1, 4, 1000])
def test_short_captures_have_cycles_where_the_interval_is_defined(cut: int) -> None:
    frames = cyclic(10_000_000, 4, (0x680, 0x681, 0x682))
    del frames[4]
    found = report(frames, cut, three_frames(interval_ns=10_000_000))
    (incomplete,) = [one for one in found["findings"] if one["code"] == "NV604"]
    assert (incomplete["count"], incomplete["frames"]) == (1, [4])
    assert incomplete["message"].startswith("1 of 3 cycles (33 %) came without all 3 frames")


@pytest.mark.parametrize("cut", [1, 7, 1000])
def test_other_frames_before_a_list_do_not_count_in_its_cycles(cut: int) -> None:
    before = [(START_NS - 100_000_000 + place * 1_000_000, 0, 0x700 + place % 3, bytes(1)) for place in range(30)]
    frames = cyclic(10_000_000, 20, (0x680, 0x681, 0x682))
    among = [(time_ns + 100_000, 0, 0x700 + place % 3, bytes(1)) for place, (time_ns, *_) in enumerate(frames)]
    found = report(sorted([*before, *frames, *among]), cut, three_frames(interval_ns=10_000_000))
    assert [one for one in found["findings"] if one["code"] == "NV604"] == []


@pytest.mark.parametrize("cut", [1, 4, 1000])
def test_a_capture_that_begins_within_a_cycle_misses_nothing(cut: int) -> None:
    frames = cyclic(10_000_000, 20, (0x680, 0x681, 0x682))
    assert report(frames[1:], cut, three_frames(interval_ns=10_000_000))["findings"] == []
    assert report(frames[2:], cut, three_frames(interval_ns=10_000_000))["findings"] == []


def test_late_bursts_and_silence_are_told_as_on_udp() -> None:
    frames = cyclic(10_000_000, 100, (0x200,))
    late = [(time_ns + (35_000_000 if place >= 50 else 0), *rest) for place, (time_ns, *rest) in enumerate(frames)]
    assert ("NV501", "can/can0/512", 0, 1) in codes(report(late, 1000))
    burst = sorted([*frames, (START_NS + 600_000_000 + 300_000, 0, 0x200, bytes(8))])
    assert ("NV503", "can/can0/512", 0, 1) in codes(report(burst, 1000))
    stopped = [*frames, (START_NS + 2_000_000_000, 0, 0x700, bytes(1))]
    assert ("NV504", "can/can0/512", 0, 1) in codes(report(stopped, 1000))


def test_a_definition_is_for_its_channel_or_for_any() -> None:
    frames = [(START_NS + number, channel, 0x681, bytes(8)) for number in range(4) for channel in (0, 1)]
    everywhere = report(frames, 100, three_frames())
    assert [(entry["key"], entry["name"]) for entry in everywhere["lists"]] == [
        ("can/can0/1664", "press"), ("can/vcan1/1664", "press"),
    ]  # fmt: skip
    there = report(frames, 100, three_frames(channel="vcan1"))
    assert [(entry["key"], entry["name"]) for entry in there["lists"]] == [
        ("can/can0/1665", None), ("can/vcan1/1664", "press"),
    ]  # fmt: skip


def test_a_defined_list_that_is_never_sent_is_silent() -> None:
    found = report(cyclic(10_000_000, 3, (0x300,)), 100, three_frames())
    (silent,) = [one for one in found["findings"] if one["code"] == "NV407"]
    assert silent["message"] == "List press (can/*/0x680) is defined, but not one frame of it was seen."


def test_many_channels_take_little_memory() -> None:
    """The index of an interface may be any number of 16 bits."""
    frames = [(START_NS + number, number * 3000 % 65_536, 0x181, bytes(8)) for number in range(40)]
    tracemalloc.start()
    found = report(frames, 100)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(found["lists"]) == 40
    assert peak < 60_000_000


def test_lists_are_missed_only_on_what_was_captured() -> None:
    on_udp = list_of([INT], list_id=7)
    both = Definition((*three_frames().lists, on_udp))
    found = report(cyclic(10_000_000, 3, (0x300,)), 100, both)
    assert [one["message"] for one in found["findings"] if one["code"] == "NV407"] == [
        "List press (can/*/0x680) is defined, but not one frame of it was seen."
    ]
    state = TrackerState()
    observed(state, [batch_of([telegram(b"\1\0", 1, subindex=0, counter=1, ts_ns=START_NS, list_id=8)])])
    messages = [one.message for one in judge(state, definition=both) if one.code == "NV407"]
    assert messages == ["List test (udp/1202/7) is defined, but not one telegram of it was seen."]
