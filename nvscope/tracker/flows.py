"""Flows: who sent what kind of telegram of which list and SubIndex to whom, counted.

A flow is the finest key there is; nodes, lists, places (list, SubIndex) and streams (place, sender) are numbered here
as flows appear. Every count of NetVarUDPDiagStruct but the errors is a sum over flows (``nvscope.tracker.summary``).
"""

from __future__ import annotations

from enum import IntEnum
from typing import ClassVar

import numpy as np

from dissectors.batch import I64, U8, U64, Bool
from dissectors.link import IPV4_HIGH, IPV4_LOW
from dissectors.netvar import HEADER, KNOWN_SERVICE, Fault, Service, TelegramBatch
from nvscope.tracker.columns import Columns
from nvscope.tracker.keys import KeyTable


class Kind(IntEnum):
    """What a telegram is to its list."""

    DATA = 0  # well-formed, as the next two
    ACKNOWLEDGEMENT = 1
    BOOT_UP_REQUEST = 2
    MALFORMED_DATA = 3
    MALFORMED_OTHER = 4
    HEADER_CUT = 5  # of which so little was captured that only its list is known
    PARAMETER = 6  # of the Parameter Manager: belongs to no list and is no flow


LIST_SERVICES = (Service.ODStateFree, Service.ODAcknowledgement, Service.ODBootUpRequest)
IS_PARAMETER = KNOWN_SERVICE.copy()
"""Mask over ID, as ``KNOWN_SERVICE``: the services of the Parameter Manager."""

IS_PARAMETER[list(LIST_SERVICES)] = False

_SOURCE_IPV6, _DESTINATION_IPV6, _BROADCAST = (np.uint64(1) << np.uint64(bit) for bit in (52, 53, 54))
_LOW_HALF = np.uint64(0xFFFFFFFF)


class FlowColumns(Columns):
    """One row a flow; ``destination`` is -1 for broadcasts, ``stream`` -1 for flows that are no well-formed data."""

    kind: I64
    list: I64
    place: I64
    stream: I64
    source: I64
    destination: I64
    count: I64
    mismatches: I64
    first_ns: I64
    first_frame: I64
    last_ns: I64
    last_frame: I64
    COLUMNS: ClassVar = {
        name: (np.int64(0), 1)
        for name in (
            "kind", "list", "place", "stream", "source", "destination", "count", "mismatches",
            "first_ns", "first_frame", "last_ns", "last_frame",
        )
    }  # fmt: skip


def kinds(telegrams: TelegramBatch) -> U8:
    """Tell what each telegram is to its list, as uint8 (``Kind``)."""
    service = telegrams.header["id"]
    kind = np.zeros(len(telegrams), np.uint8)
    special = np.flatnonzero((service != Service.ODStateFree) | (telegrams.fault != Fault.NONE))
    if len(special):
        service, fault = service[special], telegrams.fault[special]
        is_data = service == Service.ODStateFree
        kind[special] = np.select(
            [
                IS_PARAMETER[np.minimum(service, len(IS_PARAMETER) - 1)],
                fault == Fault.HEADER_CUT,
                (fault != Fault.NONE) & is_data,
                fault != Fault.NONE,
                service == Service.ODAcknowledgement,
            ],
            [Kind.PARAMETER, Kind.HEADER_CUT, Kind.MALFORMED_DATA, Kind.MALFORMED_OTHER, Kind.ACKNOWLEDGEMENT],
            Kind.BOOT_UP_REQUEST,
        )
    return kind


class Flows:
    """The keys of all that was seen, and the counts of the flows.

    ``nodes`` are keyed by the halves of their address, ``lists`` by (port, Index), ``places`` by (list, SubIndex),
    ``streams`` by (place, node).
    """

    def __init__(self) -> None:
        self.nodes = KeyTable()
        self.lists = KeyTable()
        self.places = KeyTable()
        self.streams = KeyTable()
        self.keys = KeyTable()
        self.columns = FlowColumns()

    def observe(self, telegrams: TelegramBatch, kind: U8, frame: I64) -> I64:
        """Count telegrams, none of kind PARAMETER, and return the flow of each. Shapes (n,)."""
        datagram, header = telegrams.datagram, telegrams.header
        source, source_flag = self._short(datagram.source_hi, datagram.source_lo, _SOURCE_IPV6)
        destination, destination_flag = self._short(datagram.destination_hi, datagram.destination_lo, _DESTINATION_IPV6)
        high = (source << np.uint64(32)) | (destination & _LOW_HALF)
        low = header.view(_PLACE)["place"].astype(np.uint64) | (
            datagram.destination_port.astype(np.uint64) << np.uint64(32)
        )
        if kind.any():
            low |= kind.astype(np.uint64) << np.uint64(48)
        low |= datagram.broadcast.astype(np.uint64) << np.uint64(54)
        if source_flag is not None:
            low |= source_flag
        if destination_flag is not None:
            low |= destination_flag
        known = len(self.keys)
        flow = self.keys.numbers(high, low)
        if len(self.keys) > known:
            self._describe(known)
            # Assigned backwards, so that the first telegram of each flow is what stays.
            fresh = np.flatnonzero(flow >= known)[::-1]
            self.columns.first_ns[flow[fresh]] = telegrams.ts_ns[fresh]
            self.columns.first_frame[flow[fresh]] = frame[fresh]
        last = np.full(len(self.keys), -1, np.int64)
        last[flow] = np.arange(len(flow))
        seen = np.flatnonzero(last >= 0)
        self.columns.count[: len(self.keys)] += np.bincount(flow, minlength=len(self.keys))
        self.columns.last_ns[seen] = telegrams.ts_ns[last[seen]]
        self.columns.last_frame[seen] = frame[last[seen]]
        return flow

    def place_of(self, stream: I64) -> I64:
        """Return the places of streams."""
        return self.streams.high[stream].astype(np.int64)

    def node_of(self, stream: I64) -> I64:
        """Return the nodes that send streams."""
        return self.streams.low[stream].astype(np.int64)

    def _short(self, high: U64, low: U64, flag: np.uint64) -> tuple[U64, U64 | None]:
        """Return 32 bits that stand for each address, and the bits that set those of IPv6 apart, None without any."""
        if high.strides == (0,) or not len(high):
            return low, None
        is_ipv6 = np.flatnonzero((high != IPV4_HIGH) | (low & IPV4_LOW != IPV4_LOW))
        if not len(is_ipv6):
            return low, None
        short, flags = low.copy(), np.zeros_like(low)
        short[is_ipv6] = self.nodes.numbers(high[is_ipv6], low[is_ipv6]).astype(np.uint64)
        flags[is_ipv6] = flag
        return short, flags

    def _address(self, short: U64, is_ipv6: Bool) -> tuple[U64, U64]:
        node = np.where(is_ipv6, short, np.uint64(0)).astype(np.int64)
        if not is_ipv6.any():
            return np.full_like(short, IPV4_HIGH), short | IPV4_LOW
        return (
            np.where(is_ipv6, self.nodes.high[node], IPV4_HIGH),
            np.where(is_ipv6, self.nodes.low[node], short | IPV4_LOW),
        )

    def _describe(self, known: int) -> None:
        """Fill the columns of new flows from their keys, numbering what is new in them."""
        high, low = self.keys.high[known:], self.keys.low[known:]
        columns = self.columns
        columns.resize(len(self.keys))
        new = slice(known, len(self.keys))
        kind = (low >> np.uint64(48)) & np.uint64(0xF)
        unicast = (low & _BROADCAST) == 0
        source = self.nodes.numbers(*self._address(high >> np.uint64(32), (low & _SOURCE_IPV6) != 0))
        to_hi, to_lo = self._address(high & _LOW_HALF, (low & _DESTINATION_IPV6) != 0)
        destination = np.full(len(high), -1, np.int64)
        destination[unicast] = self.nodes.numbers(to_hi[unicast], to_lo[unicast])
        index, subindex = low & np.uint64(0xFFFF), (low >> np.uint64(16)) & np.uint64(0xFFFF)
        lists = self.lists.numbers((low >> np.uint64(32)) & np.uint64(0xFFFF), index)
        place = self.places.numbers(lists.astype(np.uint64), subindex)
        stream = np.full(len(high), -1, np.int64)
        data = kind == Kind.DATA
        stream[data] = self.streams.numbers(place[data].astype(np.uint64), source[data].astype(np.uint64))
        columns.kind[new], columns.list[new], columns.place[new], columns.stream[new] = kind, lists, place, stream
        columns.source[new], columns.destination[new] = source, destination


# Index and SubIndex are read as one 32-bit number, Index in its lower half.
_PLACE = np.dtype(
    {"names": ["place"], "formats": ["<u4"], "offsets": [HEADER.offset_of("index")], "itemsize": HEADER.size_bytes}
)
