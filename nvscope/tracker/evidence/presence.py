"""Presence: who is there, from when to when, how often they are heard, and which addresses are those of one device."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.addresses import FrameAddresses, addresses_of
from dissectors.batch import I64, U64, Bool
from dissectors.carried import Carrier
from dissectors.keys import KeyTable
from dissectors.netvar import LIST_SERVICES
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.tracker.buckets import bucket_of

MOST_ADDRESSES = 1 << 16
"""So many addresses are kept, and so many pairs of them, and announcements; what is left out is counted."""

HARDWARE, IP = 0, 1
"""The first word of the key of an address; the others are its halves, of a hardware address 0 and the address."""

_BUCKET_OFFSET = 1 << 20
_ROW_BIT = 32
_VLAN_BIT = np.uint64(48)


class AddressColumns(KeyedColumns):
    """One row an address: its frames, those that are no telegrams of lists, the last of these, and the last pair."""

    count: I64
    first_ns: I64
    last_ns: I64
    others: I64
    last_other_ns: I64
    pair: I64
    COLUMNS: ClassVar = {
        **{name: (np.int64(0), 1) for name in ("count", "first_ns", "last_ns", "others", "last_other_ns")},
        "pair": (np.int64(-1), 1),
    }


class PairColumns(KeyedColumns):
    """One row an IP address with the device that it is told by.

    ``alternations`` counts its frames that follow one of the same IP address from another hardware address.
    """

    count: I64
    first_ns: I64
    last_ns: I64
    alternations: I64
    COLUMNS: ClassVar = {name: (np.int64(0), 1) for name in ("count", "first_ns", "last_ns", "alternations")}


class DistanceColumns(KeyedColumns):
    """One row an address and bucket of a distance between two of its frames that are no telegrams of lists."""

    count: I64
    COLUMNS: ClassVar = {"count": (np.int64(0), 1)}


class Announcements:
    """ARP messages that tell an address nobody asked for, in the order of the capture; ``parts`` of the columns.

    These are time, frame, the row of the IP address, and the hardware address.
    """

    def __init__(self) -> None:
        self._parts: list[tuple[I64, I64, I64, U64]] = []
        self.count = 0

    def add(self, time_ns: I64, frame: I64, address: I64, hardware: U64) -> None:
        """Take some that follow."""
        if len(frame):
            self.count += len(frame)
            self._parts.append((time_ns, frame, address, hardware))

    def columns(self) -> tuple[I64, I64, I64, U64]:
        """Return the columns, all of shape (n,)."""
        nothing = np.empty(0, np.int64)
        first = nothing, nothing, nothing, np.empty(0, np.uint64)
        time_ns, frame, address, hardware = (np.concatenate(parts) for parts in zip(first, *self._parts, strict=True))
        return time_ns, frame, address, hardware


class Presence:
    """An observer of all frames.

    ``addresses`` number the hardware and IP addresses that sent some, which are the rows of ``columns``; ``pairs``
    number (upper half, lower half, hardware address with VLAN + 1 above it, time to live), the rows of
    ``pair_columns``. ``distances`` number (row of ``columns`` << 32 | bucket), the rows of ``distance_columns``: see
    ``distances_of``. ``left_out`` counts the frames of addresses and pairs for which there was no room.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_ADDRESSES) -> None:
        self._most = most
        self.addresses, self.columns = KeyTable(3), AddressColumns()
        self.pairs, self.pair_columns = KeyTable(4), PairColumns()
        self.distances, self.distance_columns = KeyTable(1), DistanceColumns()
        self.announcements = Announcements()
        self.left_out = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        found = addresses_of(told.packets)
        if not len(found):
            return
        time_ns, other = told.packets.ts_ns[found.row], ~_of_lists(told)[found.row]
        known = np.flatnonzero(found.hardware)
        nothing = np.zeros(len(known), np.uint64)
        number = self._numbers(self.addresses, nothing + np.uint64(HARDWARE), nothing, found.hardware[known])
        self._observe_addresses(number, time_ns[known], other[known])
        known = np.flatnonzero(found.has_ip)
        kind = np.full(len(known), IP, np.uint64)
        number = self._numbers(self.addresses, kind, found.high[known], found.low[known])
        self._observe_addresses(number, time_ns[known], other[known])
        self._observe_pairs(found.take(known), number, time_ns[known])
        announced = np.flatnonzero(found.announces[known] & (number >= 0))
        room = self._most - self.announcements.count
        self.left_out += max(len(announced) - room, 0)
        own = known[announced[:room]]
        frame = found.row[own] + told.first_frame
        self.announcements.add(time_ns[own], frame, number[announced[:room]], found.hardware[own])

    def distances_of(self, address: int) -> tuple[I64, I64]:
        """Return buckets (``nvscope.tracker.buckets``), rising, and how many distances of an address lie in each."""
        word = self.distances.high.view(np.int64)
        own = np.flatnonzero(word >> _ROW_BIT == address)
        bucket = (word[own] & ((1 << _ROW_BIT) - 1)) - _BUCKET_OFFSET
        order = np.argsort(bucket)
        return bucket[order], self.distance_columns.column("count")[own][order]

    def _numbers(self, table: KeyTable, *words: U64) -> I64:
        """Return the numbers of keys, -1 of those for which there is no room, which are counted."""
        if len(table) < self._most:
            table.numbers(*words)
        number = table.find(*words)
        number[number >= self._most] = -1
        self.left_out += int(np.count_nonzero(number < 0))
        return number

    def _observe_addresses(self, number: I64, time_ns: I64, other: Bool) -> None:
        """Count frames of addresses: their numbers, -1 of what is left out, and which are no telegrams of lists."""
        columns = self.columns
        columns.resize(min(len(self.addresses), self._most))
        _count(columns, number, time_ns)
        row = np.flatnonzero(other & (number >= 0))
        row = row[stable_order(number[row], len(columns))]
        start, stop = runs_of(number[row])
        if not len(start):
            return
        run, own_ns = number[row[start]], time_ns[row]
        before_ns = np.roll(own_ns, 1)
        before_ns[start] = columns.last_other_ns[run]
        follows = np.ones(len(row), np.bool_)
        follows[start] = columns.others[run] > 0
        bucket = bucket_of((own_ns - before_ns)[follows]) + _BUCKET_OFFSET
        distance = self.distances.numbers((number[row[follows]] << _ROW_BIT | bucket).view(np.uint64))
        self.distance_columns.resize(len(self.distances))
        np.add.at(self.distance_columns.count, distance, 1)
        columns.others[run] += stop - start
        columns.last_other_ns[run] = own_ns[stop - 1]

    def _observe_pairs(self, found: FrameAddresses, address: I64, time_ns: I64) -> None:
        """Count IP packets by whom they come from; what ARP says is about an address, and has no time to live."""
        row = np.flatnonzero((found.ttl >= 0) & (found.hardware != 0) & (address >= 0))
        device = found.hardware[row] | (found.vlan[row] + 1).astype(np.uint64) << _VLAN_BIT
        pair = self._numbers(self.pairs, found.high[row], found.low[row], device, found.ttl[row].astype(np.uint64))
        row, pair = row[pair >= 0], pair[pair >= 0]
        columns = self.pair_columns
        columns.resize(min(len(self.pairs), self._most))
        _count(columns, pair, time_ns[row])
        order = stable_order(address[row], len(self.columns))
        number, pair = address[row[order]], pair[order]
        start, stop = runs_of(number)
        if not len(start):
            return
        before = np.roll(pair, 1)
        before[start] = self.columns.pair[number[start]]
        hardware = self.pairs.words[2] & ((np.uint64(1) << _VLAN_BIT) - np.uint64(1))
        alternates = (before >= 0) & (hardware[before] != hardware[pair])
        np.add.at(columns.alternations, pair[alternates], 1)
        self.columns.pair[number[start]] = pair[stop - 1]


def _of_lists(told: Told) -> Bool:
    """Tell which packets of a batch hold telegrams that belong to a list."""
    varieties = told.varieties
    by_variety: Bool = np.zeros(len(varieties), np.bool_)
    on_udp = np.flatnonzero(varieties.carried.carrier == Carrier.UDP)
    by_variety[on_udp] = np.isin(varieties.telegrams_of(on_udp).header["id"], LIST_SERVICES)
    return by_variety[told.variety]


def _count(columns: AddressColumns | PairColumns, number: I64, time_ns: I64) -> None:
    """Count frames by their numbers, where these are not -1, and note when the first and the last one came."""
    row = np.flatnonzero(number >= 0)
    row = row[stable_order(number[row], len(columns))]
    start, stop = runs_of(number[row])
    if not len(start):
        return
    run = number[row[start]]
    begins = columns.count[run] == 0
    columns.first_ns[run[begins]] = time_ns[row[start[begins]]]
    columns.last_ns[run] = time_ns[row[stop - 1]]
    columns.count[run] += stop - start
