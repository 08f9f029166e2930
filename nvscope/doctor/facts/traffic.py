"""What came in while somebody listened, or what capture files hold: counted by who sent it, where to, and how."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from ipaddress import IPv4Address
from typing import Any, NamedTuple, TypeVar

import numpy as np
from msgspec import Struct, field

from dissectors import address
from dissectors.batch import I64, Direction, LinkType, PacketBatch
from dissectors.headers import ARP, ETHERNET, IPV4, IPV6, TYPE_ARP
from dissectors.link import LAYOUTS_WITH_TYPE, network_layers, step_over_tags
from dissectors.netvar import HEADER, IDENTITY, IDENTITY_ASCII, KNOWN_SERVICE, Dissection, Service, dissect
from dissectors.transport import Place, QuotedBatch

MOST_FLOWS = 20_000
_FOUR_BYTES = 4
_MAC_BYTES = 6
_REQUEST, _REPLY = 1, 2
_LENGTH_AT, _SERVICE_AT = HEADER.offset_of("length"), HEADER.offset_of("id")


class Flow(NamedTuple):
    """Telegrams that have in common where they were seen, from whom to whom, of which list, and how they came.

    ``is_list``: of a list, and no conversation of the Parameter Manager. ``wants_answer``: an acknowledgement is asked
    for; ``is_answer``: it is one. ``hops`` is the time to live, 0 where nobody tells; ``vlan`` the outermost tag, -1
    without one. ``hardware`` is the sender's address on the wire, "" without one. ``is_own``: sent from here.
    """

    place: int
    source: str
    target: str
    port: int
    list_id: int
    is_list: bool
    wants_answer: bool
    is_answer: bool
    is_ascii: bool
    hops: int
    vlan: int
    to_all: bool
    hardware: str
    is_own: bool


class Stranger(NamedTuple):
    """Datagrams that are no telegrams: ``begin`` are their first four bytes; ``is_like_one``: the rest is a header."""

    place: int
    source: str
    port: int
    begin: bytes
    is_like_one: bool


class Refusal(NamedTuple):
    """Telegrams to a node and port that somebody sent back (ICMP), with the code that says why."""

    by: str
    source: str
    target: str
    port: int
    code: int


class Question(NamedTuple):
    """Who asks on the wire (ARP) for which address."""

    asker: str
    wanted: str


_Entry = TypeVar("_Entry", Flow, Stranger, Refusal, Question)


class ListenedTo(Struct, frozen=True):
    """Where it was listened, or a file that was read.

    ``sees_all``: also what is not for this machine. ``failure`` is why it ended early, or could not be begun.
    """

    name: str
    sees_all: bool
    frames: int = 0
    failure: str = ""
    dropped: int = 0


class Traffic(Struct):
    """Counts what is observed; ``ports`` are those on which all datagrams are looked at, whatever they hold."""

    ports: Collection[int]
    frames: Counter[int] = field(default_factory=Counter)
    flows: Counter[Flow] = field(default_factory=Counter)
    strangers: Counter[Stranger] = field(default_factory=Counter)
    refusals: Counter[Refusal] = field(default_factory=Counter)
    questions: Counter[Question] = field(default_factory=Counter)
    answered: set[str] = field(default_factory=set)
    left_out: int = 0

    def observe(self, batch: PacketBatch, place: int) -> None:
        """Take packets that were seen at a place; nothing of them is kept."""
        if not len(batch):
            return
        self.frames[place] += len(batch)
        packets = batch.with_margin()
        found = dissect(packets)
        self._count_telegrams(packets, found, place)
        self._count_strangers(packets, found, place)
        self._count_refusals(found)
        self._count_questions(packets)

    def _count(self, counter: Counter[_Entry], entry: _Entry, times: int) -> None:
        if entry not in counter and len(counter) >= MOST_FLOWS:
            self.left_out += times
        else:
            counter[entry] += times

    def _count_telegrams(self, packets: PacketBatch, found: Dissection, place: int) -> None:
        telegrams = found.telegrams
        if not len(telegrams):
            return
        datagram, header = telegrams.datagram, telegrams.header
        hops, vlan = _hops_and_tags(packets, telegrams.row)
        hardware = _hardware(packets, telegrams.row)
        service = np.minimum(header["id"], len(KNOWN_SERVICE) - 1)
        columns = {
            "source_hi": datagram.source_hi, "source_lo": datagram.source_lo, "target_hi": datagram.destination_hi,
            "target_lo": datagram.destination_lo, "port": datagram.destination_port, "index": header["index"],
            "is_list": service <= Service.ODBootUpRequest, "parameter": (service >= 1) & (service <= 4),
            "wants": (service == Service.ODStateFree) & ((header["flags"] & 1) != 0),
            "answer": service == Service.ODAcknowledgement, "ascii": header["identity"] == IDENTITY_ASCII,
            "hops": hops, "vlan": vlan, "all": datagram.broadcast, "hardware": hardware,
            "own": packets.directions[telegrams.row] == Direction.TX,
        }  # fmt: skip
        for row, times in _distinct(columns):
            flow = Flow(
                place, address.text(row["source_hi"], row["source_lo"]),
                address.text(row["target_hi"], row["target_lo"]), row["port"], row["index"],
                bool(row["is_list"]) and not row["parameter"], bool(row["wants"]), bool(row["answer"]),
                bool(row["ascii"]), row["hops"], row["vlan"], bool(row["all"]), _told_hardware(row["hardware"]),
                bool(row["own"]),
            )  # fmt: skip
            self._count(self.flows, flow, times)

    def _count_strangers(self, packets: PacketBatch, found: Dissection, place: int) -> None:
        datagram = found.peeled.udp.holding(_FOUR_BYTES)
        if not len(datagram):
            return
        header = HEADER.gather(packets.data, datagram.payload)
        identity = header["identity"]
        known = (identity == IDENTITY) | (identity == IDENTITY_ASCII)
        like_one = datagram.captured_bytes >= HEADER.size_bytes
        like_one &= header["length"] == datagram.payload_bytes
        like_one &= KNOWN_SERVICE[np.minimum(header["id"], len(KNOWN_SERVICE) - 1)]
        like_one &= header["items"] > 0
        wanted = ~known & (like_one | np.isin(datagram.destination_port, list(self.ports)))
        if not wanted.any():
            return
        chosen = datagram.take(wanted)
        columns = {
            "source_hi": chosen.source_hi, "source_lo": chosen.source_lo, "port": chosen.destination_port,
            "begin": identity[wanted], "like_one": like_one[wanted],
        }  # fmt: skip
        for row, times in _distinct(columns):
            stranger = Stranger(
                place, address.text(row["source_hi"], row["source_lo"]), row["port"],
                row["begin"].to_bytes(_FOUR_BYTES, "little"), bool(row["like_one"]),
            )  # fmt: skip
            self._count(self.strangers, stranger, times)

    def _count_refusals(self, found: Dissection) -> None:
        quoted = found.quoted.datagram
        if not isinstance(quoted, QuotedBatch) or not len(quoted):
            return
        columns = {
            "by_hi": quoted.by_hi, "by_lo": quoted.by_lo, "source_hi": quoted.source_hi, "source_lo": quoted.source_lo,
            "target_hi": quoted.destination_hi, "target_lo": quoted.destination_lo, "port": quoted.destination_port,
            "code": quoted.code,
        }  # fmt: skip
        for row, times in _distinct(columns):
            refusal = Refusal(
                address.text(row["by_hi"], row["by_lo"]), address.text(row["source_hi"], row["source_lo"]),
                address.text(row["target_hi"], row["target_lo"]), row["port"], row["code"],
            )  # fmt: skip
            self._count(self.refusals, refusal, times)

    def _count_questions(self, packets: PacketBatch) -> None:
        rows = np.flatnonzero((packets.link == LinkType.ETHERNET) & (packets.captured >= ETHERNET.size_bytes))
        if not len(rows):
            return
        at = packets.offset[rows]
        kind = ETHERNET.gather(packets.data, at)["type"].astype(np.uint16)
        inside = Place(rows, at + ETHERNET.size_bytes, at + packets.captured[rows], np.zeros(len(rows), np.uint8))
        step_over_tags(packets.data, inside, kind)
        inside = inside.take((kind == TYPE_ARP) & (inside.at + ARP.size_bytes <= inside.end))
        if not len(inside.row):
            return
        told = ARP.gather(packets.data, inside.at)
        for row, times in _distinct({name: told[name] for name in ("operation", "sender", "target")}):
            asker, wanted = str(IPv4Address(row["sender"])), str(IPv4Address(row["target"]))
            if len(self.answered) < MOST_FLOWS:
                self.answered.add(asker)  # who asks is there
            if row["operation"] == _REQUEST and row["sender"] and asker != wanted:
                self._count(self.questions, Question(asker, wanted), times)


def _distinct(columns: Mapping[str, Any]) -> Sequence[tuple[dict[str, int], int]]:
    """Return the rows that differ in some columns, each with how often it is there."""
    count = len(next(iter(columns.values())))
    kind = np.dtype([(name, "<i8" if column.dtype.kind == "i" else "<u8") for name, column in columns.items()])
    rows = np.empty(count, kind)
    for name, column in columns.items():
        rows[name] = column
    _, first, times = np.unique(rows.view(f"V{kind.itemsize}"), return_index=True, return_counts=True)
    names = list(columns)
    return [
        (dict(zip(names, row, strict=True)), int(number))
        for row, number in zip(rows[first].tolist(), times.tolist(), strict=True)
    ]


def _hops_and_tags(packets: PacketBatch, rows: I64) -> tuple[I64, I64]:
    """Return the times to live of packets and their outermost VLAN tags."""
    hops, tags = np.zeros(len(packets), np.int64), np.full(len(packets), -1, np.int64)
    links = packets.link[rows]
    for link in np.unique(links).tolist():
        mine = rows[links == link]
        for is_ipv4, network in network_layers(packets, link, mine):
            layout = IPV4 if is_ipv4 else IPV6
            inside = network.take(network.at + layout.size_bytes <= network.end)
            head = layout.gather(packets.data, inside.at)
            hops[inside.row] = head["ttl" if is_ipv4 else "hop_limit"]
        layout_of_link = LAYOUTS_WITH_TYPE.get(link)
        if layout_of_link is not None:
            at, size = packets.offset[mine], layout_of_link.size_bytes
            kind = layout_of_link.gather(packets.data, at)["type"].astype(np.uint16)
            group = np.zeros(len(mine), np.uint8)
            tags[mine] = step_over_tags(
                packets.data, Place(mine, at + size, at + packets.captured[mine], group), kind
            )  # fmt: skip
    return hops[rows], tags[rows]


def _hardware(packets: PacketBatch, rows: I64) -> I64:
    """Return the hardware addresses of the senders as numbers, -1 where the link has none."""
    found = np.full(len(rows), -1, np.int64)
    own = np.flatnonzero(packets.link[rows] == LinkType.ETHERNET)
    if len(own):
        at = packets.offset[rows[own]] + _MAC_BYTES
        octets = packets.data[at[:, None] + np.arange(_MAC_BYTES)].astype(np.int64)
        found[own] = octets @ (256 ** np.arange(_MAC_BYTES - 1, -1, -1, dtype=np.int64))
    return found


def _told_hardware(number: int) -> str:
    return "" if number < 0 else number.to_bytes(_MAC_BYTES, "big").hex(":")
