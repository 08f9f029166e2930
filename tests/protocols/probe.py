"""Probe, an invented protocol over TCP; each of its messages lies in one segment.

A probe is ``PB`` and a number, to port 4713.
"""

from __future__ import annotations

from dataclasses import dataclass

from scapy.layers.inet import IP, TCP
from scapy.layers.inet6 import IPv6
from scapy.layers.l2 import Dot1Q, Ether

from dissectors.batch import I64, Bool, PacketBatch, Records
from dissectors.claims import Claims
from dissectors.dissector import Dissector
from dissectors.layout import Field, Layout, take_rows
from dissectors.transport import DatagramBatch, SegmentBatch
from nvscope.expression.typed_columns import FieldType
from nvscope.protocols.protocol import Protocol
from nvscope.view.fields.field import TelegramField
from nvscope.view.lines.message_line import MessageLines
from nvscope.view.lines.message_tree import MessageTree

NAME, PORT = "probe", 4713
LAYOUT = Layout(
    NAME,
    (Field("magic", ">u2", "Magic", "PB", base="hex"), Field("number", ">u2", "Number", "counts up")),
    "Probe",
)


@dataclass(frozen=True, slots=True)
class ProbeBatch:
    """The probes of a packet batch."""

    segment: SegmentBatch
    header: Records

    @property
    def row(self) -> I64:
        return self.segment.row

    def __len__(self) -> int:
        return len(self.header)

    def take(self, rows: I64 | Bool) -> ProbeBatch:
        return ProbeBatch(self.segment.take(rows), take_rows(self.header, rows))


def dissect(batch: PacketBatch, _: DatagramBatch, segments: SegmentBatch) -> ProbeBatch:
    segments = segments.holding(LAYOUT.size_bytes)
    header = LAYOUT.gather(batch.data, segments.payload)
    own = header["magic"] == 0x5042
    return ProbeBatch(segments.take(own), take_rows(header, own))


FIELDS = (
    TelegramField(
        "probe.number", FieldType.UNSIGNED, "Number", "counts up", lambda part: part.header["number"], of=NAME
    ),
)  # fmt: skip

PROBE = Protocol(
    name=NAME,
    title="Probe",
    dissector=lambda: Dissector(NAME, Claims(tcp=(PORT,)), dissect),
    fields=lambda: FIELDS,
    lines=lambda: lambda moment, width, wording: MessageLines(
        NAME, lambda part: [f"#{number}" for number in part.header["number"].tolist()], moment, width, wording
    ),
    tree=lambda: lambda rows, _, *, dumps: MessageTree(rows, NAME, LAYOUT, dumps=dumps),
)  # fmt: skip


def probe(number: int, *, options: int = 0, v6: bool = False, tagged: bool = False, more: bytes = b"") -> bytes:
    """Return a frame with a probe; ``options`` are words of 4 bytes in the TCP header."""
    ip = IPv6(src="fe80::1", dst="fe80::2") if v6 else IP(src="10.0.0.1", dst="10.0.0.2")
    tcp = TCP(sport=40_000, dport=PORT, seq=7, ack=9, flags="PA", options=[("NOP", None)] * (4 * options))
    link = Ether(src="02:00:00:00:00:01", dst="02:00:00:00:00:02")
    return bytes((link / Dot1Q(vlan=5) if tagged else link) / ip / tcp / (b"PB" + number.to_bytes(2, "big") + more))
