"""Presence: who is there, from when to when, how often they are heard, and which addresses are those of one device."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.addresses import FrameAddresses, addresses_of
from dissectors.batch import I64, U64, Bool
from dissectors.carried import Carrier
from dissectors.keys import KeyTable
from dissectors.netvar import LIST_SERVICES
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.tracker.events import EventRows
from nvscope.tracker.latency import Latencies

MOST_ADDRESSES = 1 << 16
"""So many addresses are kept, and so many pairs of them, and announcements; what is left out is counted."""

NEVER = np.iinfo(np.int64).min

HARDWARE, IP = 0, 1
"""The first word of the key of an address; the others are its halves, of a hardware address 0 and the address."""

_VLAN_BIT = np.uint64(48)


class SeenColumns(EventRows):
    """One row an address, or a pair of them: its frames."""

    def add_frames(self, number: I64, time_ns: I64, frame: I64, rows: int) -> None:
        """Add frames to ``rows`` rows, by their numbers, -1 of what is left out."""
        self.resize(rows)
        place = np.flatnonzero(number >= 0)
        place = place[stable_order(number[place], rows)]
        start, stop = runs_of(number[place])
        self.add(number[place[start]], start, stop, time_ns, frame, place)


class AddressColumns(SeenColumns):
    """One row an address; ``others`` are its frames that are no telegrams of lists, ``pair`` is the last one it had.

    ``last_other_ns`` is ``NEVER``, and ``pair`` -1, before the first, and after nobody has listened.
    """

    others: I64
    last_other_ns: I64
    pair: I64
    COLUMNS: ClassVar = EventRows.COLUMNS | {
        "others": (np.int64(0), 1), "last_other_ns": (np.int64(NEVER), 1), "pair": (np.int64(-1), 1),
    }  # fmt: skip


class PairColumns(SeenColumns):
    """One row an IP address with the device that it is told by.

    ``alternations`` counts its frames that follow one of the same IP address from another hardware address.
    """

    alternations: I64
    COLUMNS: ClassVar = EventRows.COLUMNS | {"alternations": (np.int64(0), 1)}


class Announcements:
    """ARP messages that tell an address nobody asked for, in the order of the capture.

    Their columns are time, frame, the row of the IP address, and the hardware address.
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
    ``pair_columns``. ``distances`` are those between an address's frames that are no telegrams of lists, by the rows of
    ``columns``. ``left_out`` counts the frames of addresses and pairs for which there was no room.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_ADDRESSES) -> None:
        self._most = most
        self.addresses, self.columns = KeyTable(3), AddressColumns()
        self.pairs, self.pair_columns = KeyTable(4), PairColumns()
        self.distances = Latencies()
        self.announcements = Announcements()
        self.left_out = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if told.is_deaf:
            self.columns.last_other_ns[:] = NEVER
            self.columns.pair[:] = -1
        found = addresses_of(told.packets)
        if not len(found):
            return
        time_ns, other = told.packets.ts_ns[found.row], ~_of_lists(told)[found.row]
        frame = found.row + told.first_frame
        known = np.flatnonzero(found.hardware)
        nothing = np.zeros(len(known), np.uint64)
        number = self._numbers(self.addresses, nothing + np.uint64(HARDWARE), nothing, found.hardware[known])
        self._observe_addresses(number, time_ns[known], frame[known], other[known])
        known = np.flatnonzero(found.has_ip)
        kind = np.full(len(known), IP, np.uint64)
        number = self._numbers(self.addresses, kind, found.high[known], found.low[known])
        self._observe_addresses(number, time_ns[known], frame[known], other[known])
        self._observe_pairs(found.take(known), number, time_ns[known], frame[known])
        announced = np.flatnonzero(found.announces[known] & (number >= 0))
        room = self._most - self.announcements.count
        self.left_out += max(len(announced) - room, 0)
        own = known[announced[:room]]
        self.announcements.add(time_ns[own], frame[own], number[announced[:room]], found.hardware[own])

    def _numbers(self, table: KeyTable, *words: U64) -> I64:
        """Return the numbers of keys, -1 of those for which there is no room, which are counted."""
        number = table.numbers_within(self._most, *words)
        self.left_out += int(np.count_nonzero(number < 0))
        return number

    def _observe_addresses(self, number: I64, time_ns: I64, frame: I64, other: Bool) -> None:
        """Count frames of addresses: their numbers, -1 of what is left out, and which are no telegrams of lists."""
        columns = self.columns
        columns.add_frames(number, time_ns, frame, len(self.addresses))
        row = np.flatnonzero(other & (number >= 0))
        row = row[stable_order(number[row], len(columns))]
        start, stop = runs_of(number[row])
        if not len(start):
            return
        run, own_ns = number[row[start]], time_ns[row]
        before_ns = np.roll(own_ns, 1)
        before_ns[start] = columns.last_other_ns[run]
        follows = np.ones(len(row), np.bool_)
        follows[start] = columns.last_other_ns[run] != NEVER
        self.distances.observe(number[row[follows]], (own_ns - before_ns)[follows], len(columns))
        columns.others[run] += stop - start
        columns.last_other_ns[run] = own_ns[stop - 1]

    def _observe_pairs(self, found: FrameAddresses, address: I64, time_ns: I64, frame: I64) -> None:
        """Count IP packets by whom they come from; what ARP says is about an address, and has no time to live."""
        row = np.flatnonzero((found.ttl >= 0) & (found.hardware != 0) & (address >= 0))
        device = found.hardware[row] | (found.vlan[row] + 1).astype(np.uint64) << _VLAN_BIT
        pair = self._numbers(self.pairs, found.high[row], found.low[row], device, found.ttl[row].astype(np.uint64))
        row, pair = row[pair >= 0], pair[pair >= 0]
        columns = self.pair_columns
        columns.add_frames(pair, time_ns[row], frame[row], len(self.pairs))
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
