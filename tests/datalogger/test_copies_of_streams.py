"""Copies in drawn streams: those that the rules tell, all that can be proven, and never a cycle."""

from __future__ import annotations

import random
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.capture.open import open_source
from nvscope.datalogger import copies as module
from nvscope.datalogger.copies import Copies
from nvscope.datalogger.repeats import Seen
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.list_key import ListKey
from tests.datalogger.drawn_plants import frame_of, write_pcap
from tests.datalogger.drawn_streams import Stream, drawn_pauses, drawn_stream, seen_twice
from tests.datalogger.oracle_copies import copies_in
from tests.datalogger.oracle_losses import Packet
from tests.datalogger.plant_faults import MS
from tests.laws import examples

SEEDS = st.integers(0, 1_000_000)
KEY = ListKey.udp(1202, 1)
LATE = (1, 300_000, 4 * MS, 12 * MS, 30 * MS, 60 * MS, 130 * MS, 400 * MS)


def found(packets: list[Packet], defined_ns: int | None) -> set[int]:
    """Return the places of the copies that nvscope finds."""
    numbers: dict[object, int] = {}
    values = [numbers.setdefault(packet.content[1:], len(numbers)) for packet in packets]
    contents = [numbers.setdefault(packet.content, len(numbers)) for packet in packets]
    seen = Seen(
        np.array([packet.time_ns for packet in packets], np.int64),
        np.array([packet.counter for packet in packets], np.uint16),
        np.array(values, np.uint64), np.array(contents, np.uint64), defined_ns,
    )  # fmt: skip
    return set(np.flatnonzero(seen.copies()).tolist())


def captured(rng: random.Random, stream: Stream) -> list[Packet]:
    """Return a stream as it may be captured: with losses, seen twice by one or by several, or in another order."""
    packets = list(stream.sent)
    for _ in range(rng.choice([0, 1, 1, 2])):
        if rng.random() < 0.3 and len(packets) > 4:
            del packets[rng.randrange(len(packets) - 2)]
        packets = seen_twice(
            rng, packets, rng.choice(LATE), each=rng.choice([1, 1, 2, 10, 100]), off_ns=rng.choice([0, 1000, 5 * MS])
        )  # fmt: skip
    if rng.random() < 0.1 and len(packets) > 4:
        at = rng.randrange(len(packets) - 1)
        packets[at], packets[at + 1] = packets[at + 1], packets[at]
    return packets


@given(SEEDS)
@examples(2000)
def test_copies_are_those_of_the_rules(seed: int) -> None:
    rng = random.Random(seed)
    stream = drawn_stream(rng)
    packets = captured(rng, stream)
    assert found(packets, stream.defined_ns) == copies_in(packets, stream.defined_ns), stream


@given(SEEDS)
@examples(2000)
def test_no_cycle_is_a_copy(seed: int) -> None:
    """However a sender counts, what is sent and seen once makes its rows."""
    stream = drawn_stream(random.Random(seed))
    assert found(stream.sent, stream.defined_ns) == set(), stream


@given(SEEDS)
@examples(2000)
def test_no_cycle_is_a_copy_where_a_sender_pauses(seed: int) -> None:
    stream = drawn_pauses(random.Random(seed))
    assert found(stream.sent, stream.defined_ns) == copies_in(stream.sent, stream.defined_ns) == set(), stream


@pytest.mark.parametrize(
    ("every_ms", "values", "pauses", "pause_ms"),
    [(100, 600, 60, 2000), (40, 600, 19, 1240), (50, 2, 15, 950), (50, 2, 19, 1500)],
)
@pytest.mark.parametrize("is_defined", [True, False])
def test_cycles_between_pauses_are_no_copies(
    every_ms: int, values: int, pauses: int, pause_ms: int, *, is_defined: bool
) -> None:
    """A Counter that stands still, and pauses that come regularly, make nothing of this a copy."""
    times_ns = [(number * every_ms + number // pauses * pause_ms) * MS for number in range(600)]
    sent = [
        Packet(time_ns, "10.0.0.1", 1, 0, 1, 5, bytes([number // values % 256]))
        for number, time_ns in enumerate(times_ns)
    ]
    assert found(sent, every_ms * MS if is_defined else None) == set()


@given(SEEDS, st.integers(1, 3))
@examples(1000)
def test_no_cycle_is_a_copy_where_some_are_lost(seed: int, lost: int) -> None:
    rng = random.Random(seed)
    stream = drawn_stream(rng)
    sent = [one for one in stream.sent if rng.random() > lost / 100]
    assert found(sent, stream.defined_ns) == set(), stream


@given(SEEDS, st.sampled_from([1, 1, 2, 10]), st.floats(0.02, 2.2))
@examples(1000)
def test_where_the_counter_moves_what_comes_again_is_told(seed: int, each: int, share: float) -> None:
    """Of a sender that counts and sends regularly, however late what comes again comes.

    At half an interval, all are as far apart as cycles of half the interval.
    """
    rng = random.Random(seed)
    stream = drawn_stream(rng, habits=["moving"], regular=True)
    assert stream.interval_ns
    late_ns = round(share * stream.interval_ns)
    if stream.jitter > 0.05 or len(stream.sent) < 40 or (stream.defined_ns or stream.interval_ns) < stream.interval_ns:
        return
    if abs(share % 1 - 0.5) < 0.06 + stream.jitter:
        return
    packets = seen_twice(rng, stream.sent, late_ns, each=each)
    # The last one alone nobody can tell, where few are copied: nothing follows it.
    assert len(found(packets, stream.defined_ns)) >= len(packets) - len(stream.sent) - (each > 1), (stream, late_ns)
    assert len(found(packets, stream.defined_ns)) <= len(packets) - len(stream.sent), (stream, late_ns)


@pytest.mark.parametrize("block", [8, 64, 512])
@given(SEEDS, st.integers(1, 60))
@examples(100)
def test_any_cut_into_batches_tells_the_same(block: int, seed: int, packets: int) -> None:
    rng = random.Random(seed)
    stream = drawn_stream(rng)
    frames = [frame_of(packet) for packet in captured(rng, stream)]
    told = []
    before, module.BLOCK = module.BLOCK, block
    try:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "a.pcap"
            path.write_bytes(write_pcap(frames, [0] * len(frames)))
            for batch_packets in (packets, 1000):
                copies = Copies([KEY], {KEY: stream.defined_ns or 0})
                for _ in run(open_source([str(path)], batch_packets=batch_packets), Reading(), [copies]):
                    pass
                told.append(copies.found().tolist())
    finally:
        module.BLOCK = before
    assert told[0] == told[1], stream
