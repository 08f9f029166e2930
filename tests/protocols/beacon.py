"""Beacon, an invented protocol: proof that one can be added without touching the others.

A beacon is a UDP datagram to port 4711: ``BC``, what kind it is, a number that counts up, and a speed.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dissectors import address
from dissectors.batch import I64, Bool, PacketBatch, Records
from dissectors.claims import Claims
from dissectors.dissector import Dissector
from dissectors.layout import Field, Layout, take_rows
from dissectors.transport import DatagramBatch, SegmentBatch
from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.told import Told
from nvscope.expression.columns import FieldType, TextColumn
from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.protocols.protocol import Protocol
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
    header = BEACON_LAYOUT.gather(packets.data, datagrams.payload)
    own = (header["magic"] == MAGIC) & (datagrams.captured_bytes >= BEACON_LAYOUT.size_bytes)
    return BeaconBatch(datagrams.take(own), take_rows(header, own))


# observe


class BeaconCounts:
    """How many beacons each sender sent, and how many of them never came, by the halves of its address."""

    SPLIT_BY: ClassVar = SplitBy.LIST

    def __init__(self) -> None:
        self.count: dict[tuple[int, int], int] = {}
        self.lost: dict[tuple[int, int], int] = {}
        self.last: dict[tuple[int, int], int] = {}

    def observe(self, told: Told) -> None:
        if (part := told.parts.get(NAME)) is None:
            return
        assert isinstance(part, BeaconBatch)
        halves = zip(part.datagram.source_hi.tolist(), part.datagram.source_lo.tolist(), strict=True)
        for sender, number in zip(halves, part.header["number"].tolist(), strict=True):
            missing = (number - self.last[sender] - 1) % 256 if sender in self.last else 0
            self.count[sender] = self.count.get(sender, 0) + 1
            self.lost[sender] = self.lost.get(sender, 0) + missing
            self.last[sender] = number

    def take(self, part: BeaconCounts, share: Share) -> None:
        self.count |= part.count
        self.lost |= part.lost
        self.last |= part.last


# findings

BEACON_GAP = FindingKind(
    "NV991",
    "beacon-gap",
    Severity.WARNING,
    meaning="The numbers of a sender's beacons jump.",
    causes=("beacons were lost",),
    next_steps=("Look for other losses at that time.",),
    of_capture=True,
)


def judge_beacons(facts: Facts) -> Iterator[Finding]:
    counts = facts.state.others[NAME]
    assert isinstance(counts, BeaconCounts)
    for sender, lost in sorted(counts.lost.items()):
        if lost:
            message = f"{lost} of {lost + counts.count[sender]} beacons of {address.text(*sender)} never came."
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
    return MessageTree(rows, NAME, "Beacon", BEACON_LAYOUT, dumps=dumps)


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
