"""Beacon, an invented protocol: proof that one can be added without touching the others.

A beacon is a UDP datagram to port 4711: ``BC``, what kind it is, a number that counts up, and a speed.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np

from dissectors import address
from dissectors.batch import I64, Bool, PacketBatch, Records
from dissectors.claims import Claims
from dissectors.dissector import Dissector
from dissectors.keys import KeyTable
from dissectors.layout import Field, Layout, take_rows
from dissectors.transport import DatagramBatch, SegmentBatch
from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.events import EventBatch
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.expression.typed_columns import FieldType, TextColumn
from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.protocols.protocol import Protocol
from nvscope.tracker.accumulator import NO_SUMMARY, ProtocolSummary
from nvscope.view.fields.field import TelegramField
from nvscope.view.lines.message_line import MessageLines
from nvscope.view.lines.message_tree import MessageTree
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.shown import LineMaker, Tree, Wording
from nvscope.view.rows.frames import FrameRows

NAME, PORT, MAGIC = "beacon", 4711, 0x4342
KINDS = {1: "alive", 2: "leaving"}

BEACON_LAYOUT = Layout(
    NAME,
    (
        Field("magic", "<u2", "Magic", "BC", base="hex", default=MAGIC),
        Field("kind", "u1", "Kind", "what it says", values=KINDS, default=1),
        Field("number", "u1", "Number", "counts up"),
        Field("speed", ">u2", "Speed", "in rounds a minute"),
    ),
    "Beacon",
)


def payload(number: int, kind: int = 1, speed: int = 1500, more: bytes = b"") -> bytes:
    """Return the bytes of a beacon."""
    return struct.pack("<HBB", MAGIC, kind, number & 0xFF) + struct.pack(">H", speed) + more


# dissect


@dataclass(frozen=True, slots=True)
class BeaconBatch:
    """The beacons of a packet batch."""

    datagram: DatagramBatch
    header: Records

    @property
    def row(self) -> I64:
        return self.datagram.row

    def __len__(self) -> int:
        return len(self.header)

    def take(self, rows: I64 | Bool) -> BeaconBatch:
        return BeaconBatch(self.datagram.take(rows), take_rows(self.header, rows))


def dissect(packets: PacketBatch, datagrams: DatagramBatch, _: SegmentBatch) -> BeaconBatch:
    """Read the datagrams that begin with the magic number, and hold all of the header."""
    datagrams = datagrams.holding(BEACON_LAYOUT.size_bytes)
    header = BEACON_LAYOUT.gather(packets.data, datagrams.payload)
    own = header["magic"] == MAGIC
    return BeaconBatch(datagrams.take(own), take_rows(header, own))


# observe


class BeaconEvent(IntEnum):
    """What happens to beacons; the amount is how many never came, the time since is that of the one before."""

    LOST = 1


class BeaconColumns(KeyedColumns):
    """One row a sender: how many of its beacons came, how many never did, and number and time of the last one."""

    count: I64
    lost: I64
    last: I64
    last_ns: I64
    COLUMNS: ClassVar = {name: (np.int64(0), 1) for name in ("count", "lost", "last", "last_ns")}


class BeaconCounts:
    """The beacons of all senders; ``keys`` are the halves of their addresses."""

    SPLIT_BY: ClassVar = SplitBy.LIST  # of no list: all go to the first part

    def __init__(self) -> None:
        self.keys = KeyTable()
        self.columns = BeaconColumns()

    def observe(self, told: Told) -> None:
        if (part := told.parts.get(NAME)) is None:
            return
        assert isinstance(part, BeaconBatch)
        sender = self.keys.numbers(part.datagram.source_hi, part.datagram.source_lo)
        columns = self.columns
        columns.resize(len(self.keys))
        order = stable_order(sender, len(self.keys))
        sender, number, row = sender[order], part.header["number"][order].astype(np.int64), part.row[order]
        time_ns = told.packets.ts_ns[row]
        start, stop = runs_of(sender)
        run = sender[start]
        before, before_ns = np.roll(number, 1), np.roll(time_ns, 1)
        before[start] = np.where(columns.count[run] > 0, columns.last[run], number[start] - 1)
        before_ns[start] = columns.last_ns[run]
        lost = (number - before - 1) % 256
        columns.lost[run] += np.add.reduceat(lost, start)
        columns.count[run] += stop - start
        columns.last[run], columns.last_ns[run] = number[stop - 1], time_ns[stop - 1]
        gap = np.flatnonzero(lost)
        gap = gap[np.argsort(row[gap])]
        events = EventBatch.of(
            BeaconEvent.LOST, time_ns[gap], row[gap] + told.first_frame, since_ns=before_ns[gap], amount=lost[gap]
        )
        told.tell(events)

    def take(self, part: BeaconCounts, share: Share) -> None:
        self.columns.take_keyed(self.keys, part.columns, part.keys.words)

    def summary(self) -> ProtocolSummary:
        return NO_SUMMARY


# findings

BEACON_GAP = FindingKind(
    "NV991",
    "beacon-gap",
    Severity.WARNING,
    meaning="The numbers of a sender's beacons jump.",
    causes=("beacons were lost",),
    next_steps=("Look for other losses at that time.",),
    protocol=NAME,
)


def judge_beacons(facts: Facts) -> Iterator[Finding]:
    counts = facts.state.others[NAME]
    assert isinstance(counts, BeaconCounts)
    senders = zip(counts.keys.high.tolist(), counts.keys.low.tolist(), strict=True)
    columns = (counts.columns.column(name).tolist() for name in ("lost", "count"))
    for sender, lost, count in sorted(zip(senders, *columns, strict=True)):
        if lost:
            message = f"{lost} of {lost + count} beacons of {address.text(*sender)} never came."
            yield Finding(BEACON_GAP, message, lost, None, None)


# fields


def _kind(part: BeaconBatch) -> TextColumn:
    names = ("", *KINDS.values())
    return TextColumn(np.isin(part.header["kind"], list(KINDS)) * part.header["kind"].astype(np.int64), names)


FIELDS = (
    TelegramField(
        "beacon.number", FieldType.UNSIGNED, "Number", "counts up", lambda part: part.header["number"], of=NAME
    ),
    TelegramField(
        "beacon.kind", FieldType.TEXT, "Kind", "what it says", _kind,
        lambda part: np.isin(part.header["kind"], list(KINDS)), of=NAME,
    ),
    TelegramField(
        "beacon.speed", FieldType.UNSIGNED, "Speed", "in rounds a minute",
        lambda part: part.header["speed"].astype(np.uint16), of=NAME,
    ),
)  # fmt: skip


# lines


def _words(part: BeaconBatch) -> Sequence[str]:
    return [
        f"{KINDS.get(kind, f'kind {kind}')} #{number}, {speed} rpm"
        for _, kind, number, speed in part.header.tolist()
    ]  # fmt: skip


def _lines(moment: Moment, width: int | None, wording: Wording) -> LineMaker:
    return MessageLines(NAME, _words, moment, width, wording)


def _tree(rows: FrameRows, wording: Wording, *, dumps: bool) -> Tree:
    return MessageTree(rows, NAME, BEACON_LAYOUT, dumps=dumps)


BEACON = Protocol(
    name=NAME,
    title="Beacon",
    dissector=lambda: Dissector(NAME, Claims(udp=(PORT,)), dissect),
    observe=BeaconCounts,
    findings=lambda: (BEACON_GAP,),
    judge=judge_beacons,
    fields=lambda: FIELDS,
    lines=lambda: _lines,
    tree=lambda: _tree,
)
