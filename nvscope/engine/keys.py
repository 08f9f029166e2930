"""Keys: who sent what kind of telegram of which list and SubIndex to whom, numbered.

A flow is the finest key there is; nodes, lists, places (list, SubIndex) and streams (place, sender) are numbered here
as flows appear. Whoever counts something of any of them has a row for each number (``KeyedColumns``).
"""

from __future__ import annotations

from enum import IntEnum
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors import address
from dissectors.batch import I64, U8, U32, U64, Bool
from dissectors.can.pdo import PdoRules
from dissectors.carried import Carrier
from dissectors.keys import KeyTable, first_rows
from dissectors.layout import take_rows
from dissectors.netvar import (
    ACKNOWLEDGE_WANTED,
    CHECKSUM_PRESENT,
    HEADER,
    IDENTITY_ASCII,
    IS_PARAMETER,
    LIST_SERVICES,
    NO_TELEGRAMS,
    RESERVED_FLAGS,
    Fault,
    Service,
    TelegramBatch,
)
from dissectors.sorter import SortedPackets
from dissectors.transport import QuotedBatch
from dissectors.varieties import NO_TELEGRAM, Varieties
from nvscope.engine.flow_columns import FlowColumns
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.limit import ELSEWHERE, MAX_STREAMS, LeftOut, Missing, pairs, with_room
from nvscope.list_key import ListKey


class FrameKind(IntEnum):
    """What a telegram is to its list."""

    DATA = 0  # well-formed, as the next two
    ACKNOWLEDGEMENT = 1
    BOOT_UP_REQUEST = 2
    MALFORMED_DATA = 3
    MALFORMED_OTHER = 4
    HEADER_CUT = 5  # of which so little was captured that only its list is known
    PARAMETER = 6  # of the Parameter Manager: belongs to no list and is no flow
    NOTHING = 7  # no telegram at all, and CAN frames that carry no data
    PDO = 8  # on CAN: data without sender and receiver
    LEFT_OUT = 9  # of a stream or flow beyond the limit: counted, and nothing else


_FLOWS = (*range(FrameKind.HEADER_CUT + 1), FrameKind.PDO)
_DATA = (FrameKind.DATA, FrameKind.PDO)
_MISSING = np.zeros(len(FrameKind), np.uint8)
_MISSING[[*_FLOWS]] = Missing.OTHERS
_MISSING[[*_DATA]], _MISSING[FrameKind.ACKNOWLEDGEMENT] = Missing.DATA, Missing.ACKNOWLEDGEMENTS

NOBODY = -1
"""The node of what has no address."""

NOBODY_KEY = NOBODY % (1 << 64)
"""The same as the table of streams has it."""

# Items, Length, Counter, Flags and Checksum are looked at as one 64-bit number, the signature.
_SIGNATURE_AT = HEADER.offset_of("items")
_SIGNATURE = np.dtype(
    {"names": ["signature"], "formats": ["<u8"], "offsets": [_SIGNATURE_AT], "itemsize": HEADER.size_bytes}
)


def _shift(name: str) -> np.uint64:
    return np.uint64(8 * (HEADER.offset_of(name) - _SIGNATURE_AT))


LENGTH_SHIFT, COUNTER_SHIFT = _shift("length"), _shift("counter")
FLAGS_SHIFT, CHECKSUM_SHIFT = _shift("flags"), _shift("checksum")
SHAPE_MASK = np.uint64(0xFFFFFFFF)
"""The part of a signature that holds Items and Length; of a PDO, 0 and the bytes of data."""


class VarietyColumns(KeyedColumns):
    """One row a variety of telegrams (``dissectors.varieties``): what it is to the tracker.

    ``flow``, ``stream``, ``place``, ``list`` and ``subindex`` are -1 where it is of none; ``node`` is who sends it and
    ``receiver`` to whom alone, ``NOBODY`` where that is not one, ``ELSEWHERE`` beyond the limit; ``signature`` has a
    Counter of 0. ``odd`` says that
    something in its header is to be noted, ``wants`` that a well-formed data telegram wants to be acknowledged,
    ``signed`` that it has a checksum.
    """

    kind: U8
    flow: I64
    stream: I64
    place: I64
    list: I64
    subindex: I64
    node: I64
    receiver: I64
    signature: U64
    odd: Bool
    wants: Bool
    signed: Bool
    COLUMNS: ClassVar = {
        "kind": (np.uint8(FrameKind.NOTHING), 1),
        "flow": (np.int64(-1), 1),
        "stream": (np.int64(-1), 1),
        "place": (np.int64(-1), 1),
        "list": (np.int64(-1), 1),
        "subindex": (np.int64(-1), 1),
        "node": (np.int64(-1), 1),
        "receiver": (np.int64(-1), 1),
        "signature": (np.uint64(0), 1),
        "odd": (np.False_, 1),
        "wants": (np.False_, 1),
        "signed": (np.False_, 1),
    }


class Begun(NamedTuple):
    """Flows whose first telegram is in a batch, by number, and the packet that holds it."""

    flow: I64
    packet: I64


NONE_BEGUN = Begun(np.empty(0, np.int64), np.empty(0, np.int64))


class Rejected(NamedTuple):
    """Telegrams of lists that came back as undeliverable, with the numbers of their list, and from and to whom.

    ``by`` is the number of the node that says so, ``code`` the ICMP code.
    """

    telegrams: TelegramBatch
    list: I64
    node: I64
    receiver: I64
    by: I64
    code: I64


NONE_REJECTED = Rejected(NO_TELEGRAMS, *[np.empty(0, np.int64)] * (len(Rejected._fields) - 1))


def kinds(service: U32, fault: U8) -> U8:
    """Tell what telegrams are to their list, as uint8 (``FrameKind``)."""
    is_data = service == Service.ODStateFree
    kind = np.select(
        [
            IS_PARAMETER[np.minimum(service, len(IS_PARAMETER) - 1)],
            fault == Fault.HEADER_CUT,
            (fault != Fault.NONE) & is_data,
            fault != Fault.NONE,
            is_data,
            service == Service.ODAcknowledgement,
        ],
        [
            FrameKind.PARAMETER, FrameKind.HEADER_CUT, FrameKind.MALFORMED_DATA, FrameKind.MALFORMED_OTHER,
            FrameKind.DATA, FrameKind.ACKNOWLEDGEMENT,
        ],
        FrameKind.BOOT_UP_REQUEST,
    )  # fmt: skip
    return kind.astype(np.uint8)


class StreamKey(NamedTuple):
    """What a stream is told by: list, SubIndex and sender; ``order`` is what senders are sorted by.

    Nobody knows who sends on CAN: there, the channel stands for the sender.
    """

    list: ListKey
    subindex: int
    sender: str
    order: tuple[bool, int]


class Keys:
    """The keys of all that was seen.

    ``nodes`` are keyed by the halves of their address, ``lists`` by (transport, port, identifier) as in
    ``dissectors.carried``, ``places`` by (list, SubIndex), ``streams`` by (place, node), ``flows`` by (source,
    destination, place, kind). ``varieties`` tells of each variety of the batch observed last what it is here. A stream
    on CAN has the node ``NOBODY``. ``pdos`` know what CAN channels are called.

    No more than ``most`` streams, and so many flows of other telegrams, are numbered, the first ones of the capture,
    and nothing that further ones alone are of; so many receivers of data beside the first one of each stream; so many
    pairs that speak of parameters; so many kinds of telegrams that came back. ``bites`` says that the limit was met by
    telegrams, ``left_out`` knows of whom something was left out.
    """

    def __init__(self, pdos: PdoRules | None = None, most: int = MAX_STREAMS) -> None:
        self.channel = (pdos or PdoRules()).channel
        self.most = most
        self._partners = KeyTable(4)
        self._rejections = KeyTable(8)
        self.nodes = KeyTable()
        self.lists = KeyTable(3)
        self.places = KeyTable()
        self.streams = KeyTable()
        self.flows = KeyTable(4)
        self.columns = FlowColumns()
        self.bites = False
        self.left_out = LeftOut()
        self.varieties = VarietyColumns()
        self._described: Varieties | None = None

    def observe(self, batch: SortedPackets) -> Begun:
        """Number what is new in a batch; return the flows that begin in it."""
        if batch.varieties is not self._described:
            self._described = batch.varieties
            self.varieties = VarietyColumns()
            self.varieties.resize(NO_TELEGRAM + 1)
        known = len(self.varieties)
        return self._describe(batch, known) if len(batch.varieties) > known else NONE_BEGUN

    def rejected(self, quoted: TelegramBatch) -> tuple[Rejected, I64]:
        """Number the lists and senders of the telegrams that ICMP messages quote; those of other services are none.

        Behind them are the packets of those that are left out.
        """
        if not len(quoted):
            return NONE_REJECTED, NONE_REJECTED.list
        mine = np.isin(quoted.header["id"], LIST_SERVICES)
        quoted = quoted if mine.all() else quoted.take(mine)
        datagram = quoted.datagram
        assert isinstance(datagram, QuotedBatch)
        number = self._rejections.numbers_within(
            self.most, datagram.source_hi, datagram.source_lo, datagram.destination_hi, datagram.destination_lo,
            datagram.by_hi, datagram.by_lo, datagram.destination_port.astype(np.uint64),
            quoted.header["index"].astype(np.uint64),
        )  # fmt: skip
        left_out = datagram.row[number < 0]
        if len(left_out):
            self.left_out.note_rejected(datagram.destination_port[number < 0], quoted.header["index"][number < 0])
            quoted = quoted.take(number >= 0)
            datagram = quoted.datagram
            assert isinstance(datagram, QuotedBatch)
        lists = self.lists.numbers(
            np.full(len(quoted), Carrier.UDP, np.uint64),
            datagram.destination_port.astype(np.uint64), quoted.header["index"].astype(np.uint64),
        )  # fmt: skip
        sender = self.nodes.numbers(datagram.source_hi, datagram.source_lo)
        receiver = self.nodes.numbers(datagram.destination_hi, datagram.destination_lo)
        by = self.nodes.numbers(datagram.by_hi, datagram.by_lo)
        return Rejected(quoted, lists, sender, receiver, by, datagram.code.astype(np.int64)), left_out

    @property
    def list_ports(self) -> I64:
        """The ports of the lists, on CAN their channels, by number."""
        return self.lists.words[1].astype(np.int64)

    def list_of_place(self, place: I64) -> I64:
        """Return the lists of places."""
        return self.places.high[place].astype(np.int64)

    def place_of(self, stream: I64) -> I64:
        """Return the places of streams."""
        return self.streams.high[stream].astype(np.int64)

    def node_of(self, stream: I64) -> I64:
        """Return the nodes that send streams."""
        return self.streams.low[stream].astype(np.int64)

    def described(self, stream: I64) -> tuple[I64, I64, I64]:
        """Return the lists, the nodes and the SubIndexes of streams."""
        place = self.place_of(stream)
        return self.list_of_place(place), self.node_of(stream), self.places.low[place].astype(np.int64)

    def list_key(self, number: int) -> ListKey:
        """Return the key of a list."""
        carrier, port, identifier = (int(word[number]) for word in self.lists.words)
        return ListKey.of(Carrier(carrier), port, identifier, self.channel)

    def list_keys(self) -> list[ListKey]:
        """Return the keys of all lists, by number."""
        carriers, ports, identifiers = (word.tolist() for word in self.lists.words)
        places = list(zip(carriers, ports, strict=True))
        # Of hundreds of thousands of lists, most have the port or the channel in common.
        first = {place: ListKey.of(Carrier(place[0]), place[1], 0, self.channel)[:2] for place in set(places)}
        return [ListKey(*first[place], identifier) for place, identifier in zip(places, identifiers, strict=True)]

    def place_key(self, stream: int) -> tuple[ListKey, int]:
        """Return list and SubIndex of a stream."""
        place = int(self.streams.high[stream])
        return self.list_key(int(self.places.high[place])), int(self.places.low[place])

    def stream_key(self, stream: int) -> StreamKey:
        """Return what a stream is told by."""
        key, subindex = self.place_key(stream)
        node = int(self.streams.low[stream].view(np.int64))
        if node == NOBODY:
            return StreamKey(key, subindex, str(key.port), (False, 0))
        halves = int(self.nodes.high[node]), int(self.nodes.low[node])
        return StreamKey(key, subindex, address.text(*halves), address.order(*halves))

    def _describe(self, batch: SortedPackets, known: int) -> Begun:
        """Fill in the columns of new varieties, numbering what is new in them as it appeared."""
        varieties, columns = batch.varieties, self.varieties
        columns.resize(len(varieties))
        fresh = np.flatnonzero(batch.variety >= known)
        first = fresh[first_rows(batch.variety[fresh] - known, len(varieties) - known)]
        order = np.argsort(first)
        new, row = order + known, first[order]
        on_udp = varieties.carried.carrier[new] == Carrier.UDP
        kind = np.empty(len(new), np.uint8)
        kind[on_udp] = self._describe_telegrams(varieties, new[on_udp])
        kind[~on_udp] = self._describe_frames(varieties, new[~on_udp])
        room, elsewhere = self._room(varieties, new, kind)
        left_out, of_what = ~room, kind[~room]
        self.bites |= bool(len(of_what) or elsewhere.any())
        kind[left_out] = FrameKind.LEFT_OUT
        columns.kind[new] = kind
        for name in ("odd", "wants", "signed"):
            getattr(columns, name)[new[left_out]] = False
        columns.receiver[new[elsewhere]] = ELSEWHERE
        self._number_nodes(varieties, new[on_udp & ~left_out])
        own = np.flatnonzero(np.isin(kind, _FLOWS))
        begun = self._number(varieties, new[own], row[own])
        if len(of_what):
            self.left_out.note(varieties, new[left_out], _MISSING[of_what], self.nodes)
        return begun

    def _room(self, varieties: Varieties, new: I64, kind: U8) -> tuple[Bool, Bool]:
        """Tell which new varieties are of what is told apart, and which of these not by their receiver."""
        room, elsewhere = np.ones(len(new), np.bool_), np.zeros(len(new), np.bool_)
        asked = np.flatnonzero(kind == FrameKind.PARAMETER)
        if len(asked):
            room[asked] = self._partners.numbers_within(self.most, *pairs(varieties, new[asked])) >= 0
        own = np.flatnonzero(np.isin(kind, _FLOWS))
        if len(self.flows) + len(own) > self.most:
            is_data = np.isin(kind[own], _DATA)
            room[own], elsewhere[own] = with_room(self, varieties, new[own], kind[own], NOBODY, is_data)
        return room, elsewhere

    def _describe_telegrams(self, varieties: Varieties, new: I64) -> U8:
        """Fill in what headers tell of varieties on UDP; return what they are (``FrameKind``)."""
        part, columns = varieties.part[new], self.varieties
        common = varieties.telegrams
        header = take_rows(common.header, part)
        kind = kinds(header["id"], common.fault[part])
        flags = header["flags"]
        signature = header.view(_SIGNATURE)["signature"].astype(np.uint64)
        columns.signature[new] = signature & ~(np.uint64(0xFFFF) << COUNTER_SHIFT)
        columns.odd[new] = (
            (common.fault[part] != Fault.NONE) | common.truncated[part] | (header["identity"] == IDENTITY_ASCII)
            | ((flags & RESERVED_FLAGS) != 0)
        )  # fmt: skip
        is_data = kind == FrameKind.DATA
        columns.wants[new] = is_data & ((flags & ACKNOWLEDGE_WANTED.mask) != 0)
        columns.signed[new] = is_data & ((flags & CHECKSUM_PRESENT.mask) != 0)
        return kind

    def _number_nodes(self, varieties: Varieties, new: I64) -> None:
        """Number who sends varieties on UDP, and to whom alone."""
        columns, datagram = self.varieties, varieties.telegrams.datagram.take(varieties.part[new])
        columns.node[new] = self.nodes.numbers(datagram.source_hi, datagram.source_lo)
        alone = np.flatnonzero(~datagram.broadcast & (columns.receiver[new] != ELSEWHERE))
        columns.receiver[new[alone]] = self.nodes.numbers(
            datagram.destination_hi[alone], datagram.destination_lo[alone]
        )

    def _describe_frames(self, varieties: Varieties, new: I64) -> U8:
        """The same for varieties on CAN, of which nobody knows who sends them."""
        self.varieties.signature[new] = varieties.carried.size_bytes[new].astype(np.uint64) << LENGTH_SHIFT
        return np.where(varieties.carried.is_data[new], FrameKind.PDO, FrameKind.NOTHING).astype(np.uint8)

    def _number(self, varieties: Varieties, new: I64, row: I64) -> Begun:
        """Number lists, places, streams and flows of new varieties that are of a list; return the flows that begin."""
        columns, carried = self.varieties, varieties.carried.take(new)
        kind, source, destination = columns.kind[new], columns.node[new], columns.receiver[new]
        is_data = np.isin(kind, _DATA)
        lists = self.lists.numbers(*(
            word.astype(np.uint64) for word in (carried.carrier, carried.port, carried.identifier)
        ))  # fmt: skip
        place = self.places.numbers(lists.astype(np.uint64), carried.subindex.astype(np.uint64))
        stream = np.full(len(new), -1)
        stream[is_data] = self.streams.numbers(place[is_data].astype(np.uint64), source[is_data].view(np.uint64))
        columns.list[new], columns.subindex[new] = lists, carried.subindex
        columns.place[new], columns.stream[new] = place, stream
        flows = len(self.flows)
        flow = self.flows.numbers(
            source.view(np.uint64), destination.view(np.uint64), place.astype(np.uint64), kind.astype(np.uint64)
        )
        columns.flow[new] = flow
        table = self.columns
        table.resize(len(self.flows))
        begun = np.flatnonzero(flow >= flows)[::-1]
        flow, row = flow[begun], row[begun]
        # Assigned backwards, so that the first telegram of each flow is what stays.
        table.kind[flow], table.list[flow], table.place[flow] = kind[begun], lists[begun], place[begun]
        for name, column in (("stream", stream), ("source", source), ("destination", destination)):
            getattr(table, name)[flow] = column[begun]
        return Begun(flow, row)
