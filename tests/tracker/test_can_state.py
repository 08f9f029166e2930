"""CAN frames tracked: against counting them one by one, whatever the cut."""

from __future__ import annotations

import random
import struct
from collections import defaultdict
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dissectors.batch import LinkType, PacketBatch
from nvscope.definition.model import Definition
from nvscope.definition.pdos import Pdos
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.document import report_document
from tests.definition.lists import INT, LREAL, list_of

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


def report(frames: list[Frame], cut: int) -> dict[str, Any]:
    state = TrackerState()
    whole = batch(frames)
    for begin in range(0, len(whole), cut):
        state.observe(whole[begin : begin + cut])
    summary = summarize(state, channels=["can0", "vcan1"])
    return report_document(state, summary, judge(state, summary=summary), [])


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


@pytest.mark.parametrize("cut", [1, 7, 64])
@pytest.mark.parametrize("seed", range(4))
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
    pdos = Pdos(definition)
    sizes = {0x190: [8, 8, 8], 0x191: [4, 2, 4], 0x192: [1, 1, 1]}
    frames = [
        (START_NS + number * 10_000_000 + place, 0, cob_id, bytes(sent[number]))
        for number in range(3)
        for place, (cob_id, sent) in enumerate(sizes.items())
    ]
    state = TrackerState()
    state.observe(batch(frames))
    summary = summarize(state, can_parts=pdos.parts)
    found = report_document(state, summary, judge(state, summary=summary, definition=definition), [], definition)
    assert [(entry["key"], entry["name"]) for entry in found["lists"]] == [
        ("can/can0/400", "press"), ("can/can0/402", None),
    ]  # fmt: skip
    assert [(s["cob_id"], s["subindex"]) for s in found["lists"][0]["streams"]] == [(0x190, 0), (0x191, 1)]
    (mismatch,) = [one for one in found["findings"] if one["code"] == "NV603"]
    assert (mismatch["list"], mismatch["subindex"], mismatch["count"]) == ("can/can0/400", 1, 1)
    assert "1 frame of 3 not of 4 bytes" in mismatch["message"]
