"""Answers to boot-up requests are the same whether each stream is looked at by itself or all of a place at once."""

from __future__ import annotations

import random

import pytest

import nvscope.tracker.acknowledgement
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of, cut, document_of, tracked

DATA, BOOT_UP = 0, 6
SERVICE_AT = 14 + 20 + 8 + 4
"""Where ID is in a frame on Ethernet."""
ALL = "255.255.255.255"


def plant(seed: int) -> list[Frame]:
    """Return three nodes that send, repeat and ask for two SubIndexes of a list, up to two seconds apart."""
    rng, frames, time_ns = random.Random(seed), list[Frame](), 0
    for number in range(300):
        time_ns += rng.choice((0, 1_000_000, 300_000_000, 999_999_999, 1_000_000_000, 2_000_000_000))
        if frames and rng.random() < 0.3:
            frames.append(frames[-rng.randint(1, min(3, len(frames)))]._replace(ts_ns=time_ns))
            continue
        asks = rng.random() < 0.3
        payload = telegram(
            BOOT_UP if asks else DATA, 7, rng.randrange(2), counter=0 if asks else number,
            data=b"" if asks else bytes(4),
        )  # fmt: skip
        frames.append(data_frame(time_ns, f"10.0.0.{rng.randint(1, 3)}", ALL, payload))
    return frames


def test_both_ways_find_the_same_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = unanswered = 0
    for seed in range(20):
        frames = plant(seed)
        packets = batch_of(frames)
        for parts in ([packets], cut(packets, 41)):
            monkeypatch.setattr(nvscope.tracker.acknowledgement, "_FEW_PAIRS", 1 << 40)
            few = tracked(parts)
            monkeypatch.setattr(nvscope.tracker.acknowledgement, "_FEW_PAIRS", 0)
            assert document_of(few) == document_of(tracked(parts))
        asked += sum(frame.data[SERVICE_AT] == BOOT_UP for frame in frames)
        unanswered += int(few.lists.columns.column("bootup_unanswered").sum())
    assert 200 < unanswered < asked - 200
