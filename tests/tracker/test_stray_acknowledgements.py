"""Acknowledgements of bytes that nobody sent: which are to be believed, and for how long."""

from __future__ import annotations

import random
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nvscope.tracker.streams
from dissectors import address
from dissectors.claims import Claims
from dissectors.link import peel
from nvscope.tracker.streams import Streams
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.oracle.rules.streams import Streams as Rules
from tests.oracle.rules.streams_told import distance
from tests.oracle.tcp import ACK, RST, peel_tcp
from tests.oracle.tcp_line import Line, tcp_frame
from tests.oracle.visu_traffic import visu_traffic
from tests.packets import batch_of, cut
from tests.tracker.test_streams import PORTS, by_the_rules, delivered, long_talks, opened_and_closed
from tests.tracker.visu.drawn_losses import captured

NEAR = 2**20


def followed(frames: Sequence[Frame], packets: int) -> Streams:
    streams, first_frame = Streams(PORTS), 1
    for batch in cut(batch_of(frames), packets):
        packed = batch.with_margin()
        streams.observe(packed, peel(packed, claims=Claims(tcp=PORTS)).tcp, first_frame)
        first_frame += len(packed)
    return streams


def lacking(frames: Sequence[Frame], packets: int) -> set[tuple[str, int]]:
    """Return the clients of which bytes are missing in front of the end."""
    streams = followed(frames, packets)
    ends = streams.connections.ends_of(streams.places.lacking_clients())
    hosts = map(address.text, *(half.tolist() for half in ends.client))
    return set(zip(hosts, ends.client_port.tolist(), strict=True))


def lacking_by_the_rules(frames: Sequence[Frame]) -> set[tuple[str, int]]:
    rules, found = Rules(PORTS), set()
    for number, frame in enumerate(frames, 1):
        for _ in rules.observe(number, frame):
            pass
    for connection in rules.connections.values():
        own, (host, port) = connection.directions[True], connection.client
        if own.begin is None or own.ended:
            continue
        told = own.had.up_to
        is_ahead = told is not None and 1 < distance(told, own.sequence) <= NEAR
        waits = rules.held.waiting.get(frozenset((connection.client, connection.server)))
        if own.kept or own.fins or connection.aside or is_ahead or waits:
            found.add((str(host), port))
    return found


def with_strays(rng: random.Random, frames: Sequence[Frame], chance: float) -> list[Frame]:
    """Return frames, and among them segments that acknowledge what nobody sent, of any connection."""
    found: list[Frame] = []
    for frame in frames:
        segment = peel_tcp(frame)
        found.append(frame)
        if segment is None or rng.random() >= chance:
            continue
        ends = (str(segment.source), segment.source_port), (str(segment.destination), segment.destination_port)
        by, other = ends if rng.random() < 0.5 else ends[::-1]
        seq, ack = (segment.seq, segment.ack) if (by, other) == ends else (segment.ack, segment.seq)
        far = NEAR - 9000, 2 * NEAR, -2 * NEAR, 2**31, rng.randrange(2**32)
        seq += rng.choice((0, 0, segment.length, 700, -700, *far))
        ack += rng.choice((1, 2, 700, 1400, 9000, -700, 2**21, 2**31 - 1, 2**31, rng.randrange(2**32)))
        flags = ACK | RST if rng.random() < 0.03 else ACK
        data = b"?" * (rng.randint(1, 900) * (rng.random() < 0.1))
        found.append(tcp_frame(frame.ts_ns, by, other, seq=seq, ack=ack, flags=flags, data=data))
    return found


@examples(120)
@given(seed=st.integers(0, 20_000), packets=st.sampled_from([1, 7, 60, 100_000]))
def test_what_is_believed_is_what_the_rules_believe(seed: int, packets: int) -> None:
    frames = with_strays(random.Random(seed), visu_traffic(seed), 0.05)
    assert delivered(cut(batch_of(frames), packets)) == by_the_rules(frames)
    assert lacking(frames, packets) == lacking_by_the_rules(frames)


@examples(60)
@given(seed=st.integers(0, 20_000), packets=st.sampled_from([60, 250, 1000]), often=st.sampled_from([0.003, 0.05]))
def test_it_is_so_at_once_as_in_turn(seed: int, packets: int, often: float) -> None:
    frames = with_strays(random.Random(seed), long_talks(seed), often)
    batches = cut(batch_of(frames), packets)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(nvscope.tracker.streams, "_FEW", 1 << 40)
        in_turn = delivered(batches), lacking(frames, packets)
        patched.setattr(nvscope.tracker.streams, "_FEW", 16)
        assert (delivered(batches), lacking(frames, packets)) == in_turn


@examples(150)
@given(seed=st.integers(0, 10**6), packets=st.sampled_from([1, 5, 1000]))
def test_all_is_believed_of_ends_that_acknowledge_what_they_have(seed: int, packets: int) -> None:
    """Whatever a capture lacks, has twice or in another order."""
    frames, _ = captured(seed)
    streams = followed(frames, packets).places.columns
    assert np.array_equal(streams.column("had"), streams.column("acknowledged"))


def talk() -> Line:
    """Return a line over which both ends have spoken, among many others."""
    line = Line().open().ask(b"ask").answer(b"answer")
    line.frames = [*(frame for port in range(50_001, 50_060) for frame in opened_and_closed(port)), *line.frames]
    return line


@pytest.mark.parametrize("packets", [1, 3, 1000])
def test_one_that_the_next_reply_contradicts_is_not_believed(packets: int) -> None:
    line = talk()
    line.segment(False, ack=line.sent[True] + 500)
    assert lacking(line.frames, packets)
    # What brings nothing may be older.
    line.segment(False)
    assert lacking(line.frames, packets)
    assert not lacking(line.answer(b"more").frames, packets)


@pytest.mark.parametrize("packets", [1, 3, 1000])
@pytest.mark.parametrize("away", [2**21, -(2**21), 2**31, 2**30])
def test_one_of_another_connection_is_never_believed(packets: int, away: int) -> None:
    line = talk()
    line.segment(False, seq=line.sent[False] + away, ack=line.sent[True] + 500)
    assert not lacking(line.frames, packets)


@pytest.mark.parametrize("packets", [1, 3, 1000])
def test_what_is_missing_is_told_whatever_strays(packets: int) -> None:
    line = talk()
    line.segment(False, ack=line.sent[True] + 900).lose(True, 500)
    assert lacking(line.answer(b"more").frames, packets)
    # Also where the reply to what came before was captured behind the acknowledgement of what is missing.
    line = talk()
    late = line.answer(b"more").frames.pop()
    line.lose(True, 500).segment(False)
    assert lacking([*line.frames, late], packets)


@pytest.mark.parametrize("packets", [1, 3, 1000])
def test_a_stray_one_makes_no_hole_of_what_comes_in_another_order(packets: int) -> None:
    line = talk()
    line.segment(False, ack=line.sent[True] + 10**6).answer(b"more").ask(b"one").ask(b"two")
    line.frames[-2:] = line.frames[:-3:-1]
    found = delivered(cut(batch_of(line.frames), packets))
    assert found == by_the_rules(line.frames)
    assert [one[:2] for one in found["10.0.0.1", 50_000, "10.0.0.5", 80, True]] == [("D", b"ask"), ("D", b"onetwo")]
