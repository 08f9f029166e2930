"""A busy plant, drawn from a seed: which lists its nodes send when, and what goes wrong. Columns of numpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64, U8, U16
from dissectors.netvar import ACKNOWLEDGE_WANTED, CHECKSUM_PRESENT
from tests.records import replace

NODES = 10
LISTS = 50
LISTS_PER_NODE = LISTS // NODES
# Ten sizes against seven intervals: nearly every pair occurs once in fifty lists.
DATA_BYTES = (4, 8, 16, 24, 40, 60, 90, 128, 180, 640)
INTERVALS_US = (10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000)
TELEGRAM_DATA_BYTES = 256
CYCLIC, EVENTS, MANY, LARGE, STEADY = "cyclic", "events", "many", "large", "steady"
KINDS = (CYCLIC, EVENTS, MANY, LARGE, STEADY)
EVENTS_PER_S = 10_000
MANY_LISTS = 5000
LARGE_DATA_BYTES = 1400
ACKNOWLEDGED_LISTS = (9, 23, 38)
CHECKSUM_LISTS = (4, 15, 26, 42, 48)
RESTARTING_NODE = NODES - 1

LOSS = 0.005
REPEATED = 0.0005
OVERTAKEN = 0.0005
MALFORMED = 0.0002  # of each kind
CHECKSUM_MISMATCH = 0.0005
ACKNOWLEDGEMENT_MISSING = 0.01
ACKNOWLEDGEMENT_NEGATIVE = 0.001
BOOT_UP_REQUESTS = 0.0001
OTHER_TRAFFIC = 0.01

START_US = 1_700_000_000_000_000

# Kinds of frames. The first group is telegrams with a whole header, the second one ready-made frames.
(
    DATA,
    CHECKSUM_WRONG,
    LENGTH_WRONG,
    SERVICE_UNKNOWN,
    ACKNOWLEDGEMENT,
    REFUSAL,
    BOOT_UP,
    SHORT,
    ARP,
    TCP,
    TCP_LONG,
    DNS,
) = range(12)
WITH_DATA = SERVICE_UNKNOWN
WITH_HEADER = BOOT_UP
KIND_NAMES = (
    "data", "checksum_wrong", "length_wrong", "service_unknown", "acknowledgement", "refusal", "boot_up",
    "short", "arp", "tcp", "tcp_long", "dns",
)  # fmt: skip


@dataclass(frozen=True)
class Streams:
    """What every stream (list, SubIndex) of the plant sends: columns of equal length."""

    list_index: U16
    subindex: U16
    data_bytes: I64
    node: I64
    flags: U8
    checksum: U8
    interval_us: I64
    first_counter: I64


@dataclass(frozen=True)
class Events:
    """Frames to be written: when, of which stream, with which counter, of which kind. Columns of equal length."""

    time_us: I64
    stream: npt.NDArray[np.int16]
    counter: U16
    kind: U8

    def __len__(self) -> int:
        return len(self.time_us)

    def __getitem__(self, rows: Any) -> Events:
        return Events(self.time_us[rows], self.stream[rows], self.counter[rows], self.kind[rows])

    @staticmethod
    def joined(parts: list[Events]) -> Events:
        return Events(
            np.concatenate([part.time_us for part in parts]),
            np.concatenate([part.stream for part in parts]),
            np.concatenate([part.counter for part in parts]),
            np.concatenate([part.kind for part in parts]),
        )


def plant(rng: np.random.Generator, kind: str = CYCLIC) -> Streams:
    """Lay out the lists; only counters' starts and checksums are random, so that every seed weighs the same."""
    rows = []
    lists = MANY_LISTS if kind == MANY else LISTS
    most = LARGE_DATA_BYTES if kind == LARGE else TELEGRAM_DATA_BYTES
    for number in range(lists):
        remaining = LARGE_DATA_BYTES if kind == LARGE else DATA_BYTES[number % len(DATA_BYTES)]
        index = number + 1
        flags = ACKNOWLEDGE_WANTED.mask * (index in ACKNOWLEDGED_LISTS) | CHECKSUM_PRESENT.mask * (
            index in CHECKSUM_LISTS
        )
        subindex = 0
        while remaining:
            size = min(remaining, most)
            rows.append(
                (index, subindex, size, number * NODES // lists, flags, INTERVALS_US[number % len(INTERVALS_US)])
            )
            remaining -= size
            subindex += 1
    index_column, subindex_column, size_column, node, flag_column, interval = np.array(rows, np.int64).T
    if kind == EVENTS:
        interval = np.full(len(rows), len(rows) * 1_000_000 // EVENTS_PER_S)
    return Streams(
        index_column.astype(np.uint16),
        subindex_column.astype(np.uint16),
        size_column,
        node,
        flag_column.astype(np.uint8),
        np.where(flag_column & CHECKSUM_PRESENT.mask, rng.integers(1, 256, len(rows)), 0).astype(np.uint8),
        interval,
        rng.integers(0, 65536, len(rows)),
    )


def telegrams(streams: Streams, count: int, rng: np.random.Generator, kind: str = CYCLIC) -> Events:
    """Return exactly ``count`` telegrams with their faults, sorted by time."""
    per_second = float((1e6 / streams.interval_us).sum())
    # Enough for what loss takes away; rounding matters for captures of a few hundred telegrams.
    span_us = int(count / per_second * 1e6 * 1.02) + 2_000_000
    parts = []
    for stream in range(len(streams.node)):
        interval = int(streams.interval_us[stream])
        cycles = np.arange(span_us // interval)
        # One generator per list: its telegrams share the jitter of their cycle.
        of_list = np.random.default_rng((int(streams.list_index[stream]), 1))
        phase = int(streams.list_index[stream]) * 7919 % interval + 120 * int(streams.subindex[stream])
        time = START_US + interval + phase + cycles * interval
        if kind == EVENTS:
            since = np.cumsum(of_list.exponential(interval, len(cycles))).astype(np.int64)
            time = START_US + interval + 120 * int(streams.subindex[stream]) + since
        else:
            jitter = of_list.normal(0, 0.005 * interval, len(cycles))
            time += np.clip(jitter, -0.02 * interval, 0.02 * interval).astype(np.int64)
        counter = streams.first_counter[stream] + cycles
        if streams.node[stream] == RESTARTING_NODE and kind != STEADY:
            counter = np.where(cycles < len(cycles) // 2, counter, cycles - len(cycles) // 2 + 1)
        sent = Events(
            time,
            np.full(len(time), stream, np.int16),
            (counter & 0xFFFF).astype(np.uint16),
            np.full(len(time), DATA, np.uint8),
        )
        parts += [sent] if kind == STEADY else faulty(stream, streams, sent, rng)
    everything = Events.joined(parts)
    in_order = np.argsort(everything.time_us, kind="stable")[:count]
    if len(in_order) < count:
        raise AssertionError("the plant sent fewer telegrams than asked for")
    return everything[in_order]


def faulty(stream: int, streams: Streams, sent: Events, rng: np.random.Generator) -> list[Events]:
    """Let one stream's telegrams suffer, and add what other nodes answer and ask."""
    sent = sent[rng.random(len(sent)) >= LOSS]
    count = len(sent)
    interval = int(streams.interval_us[stream])
    checksum_wrong = CHECKSUM_MISMATCH if streams.flags[stream] & CHECKSUM_PRESENT.mask else 0.0
    draw = rng.random(count)
    for kind, share in (
        (LENGTH_WRONG, MALFORMED), (SERVICE_UNKNOWN, MALFORMED), (SHORT, MALFORMED), (CHECKSUM_WRONG, checksum_wrong),
    ):  # fmt: skip
        sent.kind[(draw >= 0) & (draw < share)] = kind
        draw -= share
    late = rng.random(count) < OVERTAKEN
    sent.time_us[late] += int(1.3 * interval)

    repeated = sent[rng.random(count) < REPEATED]
    parts = [sent, replace(repeated, time_us=repeated.time_us + rng.integers(20, 200, len(repeated)))]
    if streams.flags[stream] & ACKNOWLEDGE_WANTED.mask:
        answered = sent[(sent.kind == DATA) & (rng.random(count) >= ACKNOWLEDGEMENT_MISSING)]
        delay = rng.integers(200, 900, len(answered))
        negative = rng.random(len(answered)) < ACKNOWLEDGEMENT_NEGATIVE
        answered.kind[:] = np.where(negative, REFUSAL, ACKNOWLEDGEMENT)
        parts.append(replace(answered, time_us=answered.time_us + delay))
    asked = sent[rng.random(count) < BOOT_UP_REQUESTS]
    asked.kind[:] = BOOT_UP
    asked.counter[:] = 0
    parts.append(replace(asked, time_us=asked.time_us + interval // 2))
    return parts


def other_traffic(count: int, first_us: int, last_us: int, rng: np.random.Generator) -> Events:
    return Events(
        np.sort(rng.integers(first_us, last_us + 1, count)),
        np.zeros(count, np.int16),
        np.zeros(count, np.uint16),
        rng.integers(ARP, DNS + 1, count).astype(np.uint8),
    )
