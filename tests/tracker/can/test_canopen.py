"""CANopen nodes by what they send, against following them frame by frame."""

from __future__ import annotations

import random
from collections import defaultdict
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.can.canopen import CanOpen, CanOpenNode, Emergency
from tests.laws import examples
from tests.packets import Batches
from tests.packets import cut as pieces_of
from tests.tracker.can.test_state import START_NS, Frame, batch

MS = 1_000_000
STATES = {0, 4, 5, 127}
AFTER = {1: 5, 2: 4, 128: 127, 129: 0, 130: 0}


def nodes_of(frames: list[Frame], cut: int = 1 << 17, channel: int = 0, **more: Any) -> list[CanOpenNode]:
    seen, whole = CanOpen(), batch(frames)
    for told in run(Batches(pieces_of(whole, cut)), Reading(), []):
        if told.can is not None:
            seen.observe(told, told.can)
    return seen.by_channel(**more).get(channel, [])


def followed(frames: list[Frame]) -> dict[int, dict[str, Any]]:
    """Follow channel 0 frame by frame."""
    nodes: dict[int, dict[str, Any]] = defaultdict(
        lambda: {"heartbeats": 0, "changes": 0, "boot_ups": 0, "state": None, "since_ns": None, "emergencies": 0}
    )
    evident: dict[str, set[int]] = defaultdict(set)
    strays: dict[int, int] = defaultdict(int)
    for time_ns, channel, word, data in frames:
        if channel or word > 0x7FF:
            continue
        if 0x701 <= word <= 0x77F and len(data) == 1 and data[0] & 0x7F in STATES:
            node, state = nodes[word - 0x700], data[0] & 0x7F
            node["heartbeats"] += 1
            node["boot_ups"] += state == 0
            if state != node["state"]:
                node["changes"] += node["state"] is not None
                node["state"], node["since_ns"] = state, time_ns
        elif 0x701 <= word <= 0x77F:
            number = word - 0x700
            strays[number] += number in nodes and nodes[number]["heartbeats"] > 0
            if strays[number] and strays[number] >= nodes[number]["heartbeats"]:
                evident["doubted"].add(number)
        elif 0x81 <= word <= 0xFF and len(data) == 8:
            nodes[word - 0x80]["emergencies"] += 1
        elif 0x601 <= word <= 0x67F and len(data) == 8:
            evident["asked"].add(word - 0x600)
        elif 0x581 <= word <= 0x5FF and len(data) == 8:
            evident["answered"].add(word - 0x580)
        elif word == 0 and len(data) == 2 and data[0] in (1, 2, 128, 129, 130) and data[1] < 128:
            evident["commanded"].add(data[1])
    # Without a heartbeat of it, a command, or an SDO with its answer, nobody knows that a node is one of CANopen.
    for number in evident["doubted"]:
        nodes[number] |= {"heartbeats": 0, "changes": 0, "boot_ups": 0}
    known = evident["commanded"] | (evident["asked"] & evident["answered"])
    return {
        number: node
        for number, node in nodes.items()
        if node["heartbeats"] or (node["emergencies"] and (number in known or 0 in known))
    }


def talk(seed: int, count: int) -> list[Frame]:
    choice = random.Random(seed)
    frames, time_ns = [], START_NS
    for _ in range(count):
        time_ns += choice.randrange(1, 10 * MS)
        word = choice.choice(
            [0x701, 0x702, 0x77F, 0x81, 0x82, 0, 0x181, 0x8000_0701, 0x700, 0x780, 0x80, 0x601, 0x581, 0x602]
        )
        length = choice.choice([1, 1, 8]) if word & 0x700 == 0x700 else choice.choice([8, 8, 2, 0])
        data = bytes(choice.choice([0, 4, 5, 5, 127, 0x85, 3]) for _ in range(length))
        frames.append((time_ns, choice.choice([0, 0, 1]), word, data))
    return frames


@examples(60)
@given(st.integers(0, 10_000), st.integers(1, 200), st.sampled_from([1, 3, 50]))
def test_nodes_are_those_found_frame_by_frame_whatever_the_cut(seed: int, count: int, cut: int) -> None:
    frames = talk(seed, count)
    found = nodes_of(frames, cut)
    assert found == nodes_of(frames)
    expected = followed(frames)
    assert {node.node for node in found} == expected.keys()
    for node in found:
        told = expected[node.node]
        if not told["heartbeats"]:
            told = {name: told[name] for name in ("heartbeats", "boot_ups", "changes", "emergencies")}
        assert {name: getattr(node, name) for name in told} == told


def test_a_node_that_boots_runs_and_fails() -> None:
    told = [b"\0", b"\x7f", b"\x05", b"\x05", b"\x04"]
    frames = [(START_NS + place * MS, 0, 0x705, data) for place, data in enumerate(told)]
    frames.append((START_NS + 9 * MS, 0, 0x85, bytes.fromhex("30 81 11 00 00 00 00 07")))
    (node,) = nodes_of(frames)
    assert node == CanOpenNode(
        5, 4, START_NS + 4 * MS, False, START_NS + 9 * MS, 5, 3, 1, 1, Emergency(0x8130, 0x11, START_NS + 9 * MS)
    )


def test_a_node_without_heartbeat_has_the_state_it_was_commanded_to() -> None:
    """The command to node 5 comes after that to all nodes; node 6 has sent nothing, and is not there."""
    emergency = bytes(8)
    frames = [
        (START_NS, 0, 0x85, emergency),
        (START_NS + 1, 0, 0x87, emergency),
        (START_NS + 2, 0, 0x000, b"\1\0"),
        (START_NS + 3, 0, 0x000, b"\x80\5"),
        (START_NS + 4, 0, 0x000, b"\2\6"),
        (START_NS + 5, 0, 0x000, b"\7\5"),  # no command
    ]
    assert [(node.node, node.state, node.since_ns, node.commanded) for node in nodes_of(frames)] == [
        (5, 127, START_NS + 3, True), (7, 5, START_NS + 2, True),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("data", "is_node"),
    [
        # A counter of another protocol meets states.
        ([bytes((value,)) for value in range(256)], False),
        ([bytes((value % 8,)) for value in range(256)], False),
        ([bytes((value, 0)) for value in (0, 4, 5)], False),
        ([b"\5", b"\5", b"\5 ", b"\5", b"\6", b"\5"], True),
        # What a device sends there before it boots says nothing against it.
        ([b"\x11", b"\x12", b"\x13", b"\0", b"\x7f", b"\5"], True),
        ([b"\0", b"\x85", b"\x05"], True),
        ([b"\5", b"\6"], False),
    ],
)
@pytest.mark.parametrize("emergencies", [0, 1])
def test_heartbeats_among_other_frames_are_no_evidence(data: list[bytes], is_node: bool, emergencies: int) -> None:
    frames: list[Frame] = [(START_NS + place, 0, 0x702, one) for place, one in enumerate(data)]
    frames += [(START_NS + 1000, 0, 0x82, bytes(8))] * emergencies
    for cut in (1, 2, 1000):
        assert [node.node for node in nodes_of(frames, cut)] == [2] * is_node


def test_the_frames_of_a_list_are_no_heartbeats() -> None:
    frames: list[Frame] = [(START_NS, 0, 0x705, b"\5"), (START_NS, 0, 0x85, bytes(8)), (START_NS, 0, 0x706, b"\5")]
    assert [node.node for node in nodes_of(frames, lists={0x705, 0x85})] == [6]
