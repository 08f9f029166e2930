"""CANopen nodes by what they send, against following them frame by frame."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Collection
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.tracker.can.canopen import CanOpen, CanOpenNode, Emergency
from tests.laws import examples
from tests.packets import Batches, recorded
from tests.packets import cut as pieces_of
from tests.tracker.can.test_state import START_NS, Frame, batch

MS = 1_000_000
STATES = {0, 4, 5, 127}
AFTER = {1: 5, 2: 4, 128: 127, 129: 0, 130: 0}


def nodes_of(
    frames: list[Frame], cut: int = 1 << 17, channel: int = 0, holes: Collection[int] = (), **more: Any
) -> list[CanOpenNode]:
    """Return the nodes of a channel; ``holes`` are in front of these frames, counted from 0."""
    bounds = [0, *sorted(holes), len(frames)]
    recordings = [pieces_of(batch(frames[begin:end]), cut) for begin, end in pairwise(bounds)]
    seen = CanOpen()
    for told in run(Batches(recorded(*recordings)), Reading(), []):
        for unheard in told.unheard:
            seen.resume(unheard)
        if told.can is not None:
            seen.observe(told, told.can)
    return seen.by_channel(**more).get(channel, [])


class Majority:
    """Whether most frames were CANopen's, frame by frame."""

    def __init__(self) -> None:
        self.own = self.strays = 0
        self.shown = self.since = self.ended = False

    def weigh(self, own: int, strays: int, *, shows: bool) -> None:
        self.own, self.strays, self.shown = self.own + own, self.strays + strays, self.shown or shows
        if self.own <= self.strays:
            self.ended |= self.since
        elif self.shown:
            self.since = True


BEGINNINGS = {
    **{first: {0x60, 0x80} for first in range(0x20, 0x30)},
    0x40: {*range(0x40, 0x50), 0x80},
    **{first: {0xA0, 0xA4, 0x80} for first in (0xC0, 0xC2, 0xC4, 0xC6)},
    **{first: {0xC0, 0xC2, 0xC4, 0xC6, 0x80} for first in (0xA0, 0xA4)},
}
"""By the first byte of an SDO request that names an object, those of the answers to it."""

SEGMENTS = {
    **{first: {0x20 | first & 0x10, 0x80} for first in range(0x20)},
    **{first: {*range(first & 0x10, (first & 0x10) + 16), 0x80} for first in (0x60, 0x70)},
}


class Dialogue:
    """The SDOs of a node, frame by frame."""

    def __init__(self) -> None:
        self.majority = Majority()
        self.forget()

    def forget(self) -> None:
        self.asked: tuple[int, bytes] | None = None
        self.in_block = self.asked_in_block = False

    def take(self, time_ns: int, data: bytes, *, asks: bool) -> None:
        asked, strays = self.asked, 0
        answers = False
        shows = False
        if asked is not None and not asks and len(data) == 8 == len(asked[1]) and time_ns - asked[0] <= 2000 * MS:
            request, object_ = asked[1][0], asked[1][1:4]
            shows = data[1:4] == object_ and data[0] in BEGINNINGS.get(request, ())
            answers = shows or data[0] in SEGMENTS.get(request, ())
        if asked is not None and not answers and not self.asked_in_block:
            lone = asked[1][0] if len(asked[1]) == 8 else -1
            strays += lone not in BEGINNINGS and lone != 0x80
        if shows:
            assert asked is not None
            self.in_block = asked[1][0] >= 0xA0 and data[0] != 0x80
        strays += not asks and not answers and not self.in_block
        self.majority.weigh(2 * answers, strays, shows=shows)
        self.asked = (time_ns, data) if asks else None
        self.asked_in_block = self.in_block


def followed(frames: list[Frame], holes: Collection[int]) -> dict[int, dict[str, Any]]:
    """Follow channel 0 frame by frame; what is known of nodes is no longer so behind holes."""
    known_state: dict[int, int] = {}
    nodes: dict[int, dict[str, Any]] = defaultdict(
        lambda: {"heartbeats": 0, "changes": 0, "boot_ups": 0, "state": None, "since_ns": None, "emergencies": 0}
    )
    doubted: set[int] = set()
    commanded: set[int] = set()
    dialogues: dict[int, Dialogue] = defaultdict(Dialogue)
    commands = Majority()
    strays: dict[int, int] = defaultdict(int)
    for place, (time_ns, channel, word, data) in enumerate(frames):
        if place in holes:
            known_state.clear()
            for dialogue in dialogues.values():
                dialogue.forget()
        if channel or word > 0x7FF:
            continue
        if 0x701 <= word <= 0x77F and len(data) == 1 and data[0] & 0x7F in STATES:
            node, state = nodes[word - 0x700], data[0] & 0x7F
            node["heartbeats"] += 1
            node["boot_ups"] += state == 0
            if state != known_state.get(word):
                node["changes"] += word in known_state
                node["state"], node["since_ns"] = state, time_ns
            known_state[word] = state
        elif 0x701 <= word <= 0x77F:
            number = word - 0x700
            strays[number] += number in nodes and nodes[number]["heartbeats"] > 0
            if strays[number] and strays[number] >= nodes[number]["heartbeats"]:
                doubted.add(number)
        elif 0x81 <= word <= 0xFF and len(data) == 8:
            nodes[word - 0x80]["emergencies"] += 1
        elif 0x601 <= word <= 0x67F or 0x581 <= word <= 0x5FF:
            dialogues[word & 0x7F].take(time_ns, data, asks=word > 0x600)
        elif word == 0:
            is_command = len(data) == 2 and data[0] in (1, 2, 128, 129, 130) and data[1] < 128
            commands.weigh(is_command, not is_command, shows=is_command)
            if is_command:
                commanded.add(data[1])
    # Without a heartbeat of it, a command, or an SDO with its answer, nobody knows that a node is one of CANopen.
    for number in doubted:
        nodes[number] |= {"heartbeats": 0, "changes": 0, "boot_ups": 0}
    known = commanded if commands.since and not commands.ended else set()
    known |= {number for number, one in dialogues.items() if one.majority.since and not one.majority.ended}
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
            [
                0x701,
                0x702,
                0x77F,
                0x81,
                0x82,
                0,
                0,
                0x181,
                0x8000_0701,
                0x700,
                0x780,
                0x80,
                *[0x601, 0x581] * 4,
                0x602,
            ]
        )
        length = choice.choice([1, 1, 8]) if word & 0x700 == 0x700 else choice.choice([8, 8, 2, 0])
        data = bytes(choice.choice([0, 4, 5, 5, 127, 0x85, 3]) for _ in range(length))
        if word in (0x601, 0x581, 0x602):
            at = choice.choice([0, 0, 0, 1])
            first = choice.choice(
                [0x40, 0x40, 0x2F, 0xC2, 0x60, 0x10] if word > 0x600 else [0x43, 0x60, 0xA4, 0x30, 0x80]
            )
            data = (bytes([first, 0, 0x10, at]) + bytes(4))[: choice.choice([8, 8, 8, 4])]
        frames.append((time_ns, choice.choice([0, 0, 1]), word, data))
    return frames


@examples(60)
@given(
    st.integers(0, 10_000), st.integers(1, 200), st.sampled_from([1, 3, 50]), st.sets(st.integers(1, 199), max_size=3)
)  # fmt: skip
def test_nodes_are_those_found_frame_by_frame_whatever_the_cut(
    seed: int, count: int, cut: int, holes: set[int]
) -> None:  # fmt: skip
    frames, holes = talk(seed, count), {place for place in holes if place < count}
    found = nodes_of(frames, cut, holes=holes)
    assert found == nodes_of(frames, holes=holes)
    expected = followed(frames, holes)
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


def test_a_state_behind_a_time_in_which_nobody_listened_is_no_change() -> None:
    """It is known since its first heartbeat behind it, or its first command, whatever it was before."""
    beats: list[Frame] = [(START_NS + place * MS, 0, 0x705, data) for place, data in enumerate([b"\5", b"\x7f"])]
    (node,) = nodes_of(beats, holes={1})
    assert (node.state, node.since_ns, node.changes, node.heartbeats) == (127, START_NS + MS, 0, 2)
    (node,) = nodes_of([beats[0], (START_NS + MS, 0, 0x705, b"\5")], holes={1})
    assert (node.state, node.since_ns, node.changes) == (5, START_NS + MS, 0)
    commands: list[Frame] = [(START_NS, 0, 0x000, b"\1\0"), (START_NS + MS, 0, 0x85, bytes(8))]
    (node,) = nodes_of(commands, holes={1})
    assert (node.state, node.since_ns, node.commanded, node.emergencies) == (None, None, False, 1)


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


def dialogue(*frames: str) -> list[Frame]:
    """Return SDOs of node 5, of which the text begins with > or <, and an emergency of it."""
    told = [(0x605 if one[0] == ">" else 0x585, bytes.fromhex(one[1:])) for one in frames]
    said: list[Frame] = [(START_NS + place * MS, 0, word, data) for place, (word, data) in enumerate(told)]
    return [*said, (START_NS + len(said) * MS, 0, 0x85, bytes(8))]


READ, TOLD = ">40 0010 00 00000000", "<43 0010 00 91010000"


@pytest.mark.parametrize(
    ("said", "is_node"),
    [
        ((READ, TOLD), True),
        ((">2B 1710 00 E8030000", "<60 1710 00 00000000"), True),
        ((READ, "<80 0010 00 00000206"), True),
        ((">2F 1710 00 01000000", "<80 1710 00 02000106"), True),
        # Segmented: the segments have a toggle bit and no object.
        (
            (">40 0810 00 00000000", "<41 0810 00 0A000000", ">60" + " 00" * 7, "<00" + " 41" * 7,
             ">70" + " 00" * 7, "<19" + " 41" * 7), True,
        ),
        ((">21 0810 00 0A000000", "<60 0810 00 00000000", ">00" + " 41" * 7, "<20" + " 00" * 7), True),
        # A block transfer: nobody answers its segments one by one.
        (
            (">C6 0810 00 0A000000", "<A4 0810 00 7F000000", *(f">{place:02X}" + " 41" * 7 for place in range(1, 20)),
             "<A2 13 7F" + " 00" * 5, ">C1" + " 00" * 7, "<A1" + " 00" * 7), True,
        ),
        # A capture may begin behind a request; a request may be lost on a node that is away, again and again.
        ((TOLD, READ, TOLD), True),
        ((READ, TOLD, *[READ] * 20), True),
        ((READ,), False),
        ((TOLD,), False),
        ((TOLD, READ), False),
        ((READ, "<43 0110 00 91010000"), False),  # another object
        ((READ, "<43 0010 01 91010000"), False),
        ((READ, "<60 0010 00 00000000"), False),  # the answer to a write
        ((READ, "<40 0010 00"), False),
        ((">2B 1710 00 E8030000", "<43 1710 00 00000000"), False),
        ((">60" + " 00" * 7, "<00" + " 41" * 7), False),  # a segment alone names no object
        ((">00" + " 00" * 7, "<00" + " 00" * 7) * 9, False),
        # Counters of another protocol, which meet a pair now and then.
        (tuple(f"{'<>'[place % 2]}{place % 256:02X}" + " 00" * 7 for place in range(600)), False),
        ((READ, TOLD, *(f"<{place:02X} 0010 00 00000000" for place in range(2)), READ, TOLD), False),
    ],
)  # fmt: skip
def test_sdos_are_evidence_where_answers_fit_their_requests(said: tuple[str, ...], is_node: bool) -> None:
    for cut in (1, 2, 1000):
        assert [node.node for node in nodes_of(dialogue(*said), cut)] == [5] * is_node


def test_an_answer_that_comes_too_late_is_none() -> None:
    (asked, answered, *rest), wait_ns = dialogue(READ, TOLD), 2000 * MS
    for late, is_node in ((0, True), (1, False)):
        frames = [asked, (asked[0] + wait_ns + late, *answered[1:]), *rest]
        assert [node.node for node in nodes_of(frames)] == [5] * is_node


@pytest.mark.parametrize(
    ("data", "is_node"),
    [
        ([b"\1\0"], True),
        ([b"\7\0", b"\1\0", b"\2\0"], True),
        ([bytes((value, 0)) for value in range(256)], False),
        ([bytes((value, 0)) for value in range(1, 4)], True),
        ([bytes((value, 0)) for value in range(1, 5)], False),
        ([b"\1\0\0", b"\1\0"], False),
        ([b"\1\x80"], False),
        ([b"\1"], False),
        ([b""], False),
    ],
)
def test_commands_are_evidence_where_most_frames_of_their_identifier_are_some(data: list[bytes], is_node: bool) -> None:
    frames: list[Frame] = [(START_NS + place, 0, 0, one) for place, one in enumerate(data)]
    frames.append((START_NS + 1000, 0, 0x82, bytes(8)))
    for cut in (1, 2, 1000):
        assert [(node.node, node.commanded) for node in nodes_of(frames, cut)] == [(2, True)] * is_node


def test_a_node_is_in_no_state_that_a_counter_commanded() -> None:
    counter: list[Frame] = [(START_NS + value, 0, 0, bytes((value, 0))) for value in range(9)]
    (node,) = nodes_of([*counter, *dialogue(READ, TOLD)])
    assert (node.node, node.state, node.commanded) == (5, None, False)
