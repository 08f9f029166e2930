"""Identifiers by channel, against counting them frame by frame."""

from __future__ import annotations

import random

from hypothesis import given
from hypothesis import strategies as st

from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.frame import dissect_can
from dissectors.can.pdo import EXTENDED
from nvscope.tracker.can.identifiers import CanIdentifiers
from tests.laws import examples
from tests.tracker.can.test_state import START_NS, Frame, batch

WORDS = [0, 0x181, 0x7FF, 0x8000_0181, 0x9FFF_FFFF, 0x4000_0181, 0x2000_0004]


@examples(60)
@given(st.integers(0, 10_000), st.integers(1, 120), st.sampled_from([1, 5, 40, 120]))
def test_identifiers_are_those_counted_frame_by_frame_whatever_the_cut(seed: int, count: int, cut: int) -> None:
    """On few channels and on many, in data frames, remote frames, and errors, which have no identifier."""
    choice, frames = random.Random(seed), []
    for place in range(count):
        word = choice.choice(WORDS)
        data = b"" if word & 0x4000_0000 else choice.randbytes(choice.randrange(9))
        frames.append((START_NS + place, choice.choice([0, 1, 63, 64, 65_535]), word, data))
    seen, whole = CanIdentifiers(), batch(frames)
    for begin in range(0, count, cut):
        part = dissect_can(whole[begin : begin + cut])
        seen.observe(part, wire_bits(part, Stuffing.EXACT), begin + 1, 1 << 20)
    columns = seen.columns
    found = {
        key: (int(columns.frames[row]), int(columns.bits[row]), int(columns.first_ns[row]), int(columns.last_ns[row]),
              int(columns.first_frame[row]), seen.lengths_of(key[0], key[1] & ~EXTENDED, extended=key[1] >= EXTENDED))
        for row, key in enumerate(zip(seen.keys.high.tolist(), seen.keys.low.tolist(), strict=True))
    }  # fmt: skip
    assert found == counted(frames)


Counted = tuple[int, int, int, int, int, list[int]]


def counted(frames: list[Frame]) -> dict[tuple[int, int], Counted]:
    bits = wire_bits(dissect_can(batch(frames)), Stuffing.EXACT).nominal.tolist()
    told: dict[tuple[int, int], Counted] = {}
    for number, (time_ns, channel, word, data) in enumerate(frames, 1):
        if word & 0x2000_0000:
            continue
        key = channel, (word & 0x1FFF_FFFF) | (EXTENDED if word >> 31 else 0)
        sent, size, first_ns, _, frame, lengths = told.get(key, (0, 0, time_ns, 0, number, []))
        if not word & 0x4000_0000:
            lengths = sorted({*lengths, len(data)})
        told[key] = sent + 1, size + bits[number - 1], first_ns, time_ns, frame, lengths
    return told
