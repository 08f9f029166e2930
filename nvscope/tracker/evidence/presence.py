"""Presence: who is there, from when to when, how often they are heard, and which addresses are those of one device."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from dissectors.addresses import FrameAddresses, addresses_of
from dissectors.batch import I64, U64, Bool
from dissectors.carried import Carrier
from dissectors.keys import KeyTable
from dissectors.netvar import LIST_SERVICES
from dissectors.varieties import Varieties
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.tracker.evidence.signs import SignsOfLife
from nvscope.tracker.latency import Latencies

MOST_ADDRESSES = 1 << 16
"""So many addresses are kept, and so many pairs of them, and announcements; what is left out is counted."""

NEVER = np.iinfo(np.int64).min

NOBODY, LEFT_OUT = -1, -2
"""In place of the number of an address that is not told, and of one for which there was no room."""

HARDWARE, IP = 0, 1
"""The first word of the key of an address; the others are its halves, of a hardware address 0 and the address."""

_VLAN_BIT = np.uint64(48)
HARDWARE_BITS = (np.uint64(1) << _VLAN_BIT) - np.uint64(1)


class SeenColumns(KeyedColumns):
    """One row an address, or a pair of them: how many frames it sent, and when the first one came."""

    count: I64
    first_ns: I64
    first_frame: I64
    COLUMNS: ClassVar = {"count": (np.int64(0), 1), "first_ns": (np.int64(0), 1), "first_frame": (np.int64(0), 1)}

    def add(self, number: I64, count: I64) -> None:
        """Count frames by row; below 0 they have none."""
        known = number >= 0
        np.add.at(self.count, number[known], count[known])

    def begin(self, number: I64, rows: int, told: Told, row: I64) -> None:
        """Let rows that are new begin with packets of a batch, rising; there are so many then."""
        before = len(self)
        self.resize(rows)
        new = np.flatnonzero(number >= before)[::-1]
        # Of several, the first one is what stays.
        self.first_ns[number[new]] = told.packets.ts_ns[row[new]]
        self.first_frame[number[new]] = told.first_frame + row[new]


class AddressColumns(SeenColumns):
    """One row an address; ``others`` are its frames that are no telegrams of lists, ``pair`` is the last one it had.

    ``last_other_ns`` is ``NEVER``, and ``pair`` ``NOBODY``, before the first, and after nobody has listened.
    """

    others: I64
    last_other_ns: I64
    pair: I64
    COLUMNS: ClassVar = SeenColumns.COLUMNS | {
        "others": (np.int64(0), 1), "last_other_ns": (np.int64(NEVER), 1), "pair": (np.int64(NOBODY), 1),
    }  # fmt: skip


class PairColumns(SeenColumns):
    """One row an IP address with the device that it is told by.

    ``alternations`` counts its frames that follow one of the same IP address from another hardware address.
    """

    alternations: I64
    COLUMNS: ClassVar = SeenColumns.COLUMNS | {"alternations": (np.int64(0), 1)}


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


class WayColumns(KeyedColumns):
    """One row a kind of packets: by which addresses they come, as numbers or ``NOBODY`` or ``LEFT_OUT``.

    ``other``: they are no telegrams of lists.
    """

    hardware: I64
    ip: I64
    pair: I64
    other: Bool
    COLUMNS: ClassVar = {
        "hardware": (np.int64(NOBODY), 1), "ip": (np.int64(NOBODY), 1), "pair": (np.int64(NOBODY), 1),
        "other": (np.False_, 1),
    }  # fmt: skip


class Presence:
    """An observer of all frames.

    ``addresses`` number the hardware and IP addresses that sent some, which are the rows of ``columns``; ``pairs``
    number (upper half, lower half, hardware address with VLAN + 1 above it, time to live), the rows of
    ``pair_columns``. ``distances`` are those between an address's frames that are no telegrams of lists, and ``signs``
    when these were, by the rows of ``columns``. ``left_out`` counts the frames of addresses and pairs for which there
    was no room.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_ADDRESSES) -> None:
        self._most = most
        self.addresses, self.columns = KeyTable(3), AddressColumns()
        self.pairs, self.pair_columns = KeyTable(4), PairColumns()
        self.distances = Latencies()
        self.signs = SignsOfLife()
        self.announcements = Announcements()
        self.left_out = 0
        # Packets with the same headers come by the same way: the first one is looked at for all, by their number.
        self._varieties: Varieties | None = None
        self._ways = WayColumns()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if told.is_deaf:
            self.columns.last_other_ns[:] = NEVER
            self.columns.pair[:] = NOBODY
        if not len(told):
            return
        if told.varieties is not self._varieties:
            self._varieties, self._ways = told.varieties, WayColumns()
            self._ways.resize(1)
        header = told.batch.header
        count = np.bincount(header, minlength=len(self._ways))
        alone = np.flatnonzero(header == 0) if count[0] else np.empty(0, np.int64)
        row = np.sort(np.append(alone, self._first_of_new(header, count)))
        looked_at = self._look_at(told, row)
        self._ways.resize(len(count))
        self._ways.put(header[row], looked_at)
        kind = np.flatnonzero(count[1:]) + 1
        seen = _Seen(header, kind, count[kind], self._ways, alone, looked_at, np.searchsorted(row, alone))
        for name, columns in (("hardware", self.columns), ("ip", self.columns), ("pair", self.pair_columns)):
            number = seen.numbers(name)
            columns.add(number, seen.count)
            self.left_out += int(seen.count[number == LEFT_OUT].sum())
        self._observe_others(told, seen)
        self._observe_alternations(seen)

    def _first_of_new(self, header: I64, count: I64) -> I64:
        """Return the first packets of headers that were not seen before, by number of the headers."""
        known = len(self._ways)
        if len(count) == known:
            return np.empty(0, np.int64)
        new = np.flatnonzero(header >= known)[::-1]
        first = np.empty(len(count), np.int64)
        first[header[new]] = new  # of several, the first one is what stays
        return first[np.flatnonzero(count[known:]) + known]

    def _look_at(self, told: Told, row: I64) -> WayColumns:
        """Return by which ways some packets come, rising, having numbered what is new of them."""
        found = addresses_of(told.packets, row)
        ways = WayColumns()
        ways.resize(len(row))
        place = np.searchsorted(row, found.row)
        ways.column("other")[:] = ~_are_of_lists(told, row)
        known = np.flatnonzero(found.hardware)
        nothing = np.zeros(len(known), np.uint64)
        keys = nothing + np.uint64(HARDWARE), nothing, found.hardware[known]
        ways.hardware[place[known]] = self._numbers(self.addresses, keys, self.columns, told, found.row[known])
        known = np.flatnonzero(found.has_ip)
        keys = np.full(len(known), IP, np.uint64), found.high[known], found.low[known]
        number = self._numbers(self.addresses, keys, self.columns, told, found.row[known])
        ways.ip[place[known]] = number
        found, place = found.take(known), place[known]
        self._observe_announcements(told, found, number)
        # What ARP says is about an address, and has no time to live.
        known = np.flatnonzero((found.ttl >= 0) & (found.hardware != 0) & (number >= 0))
        found, place = found.take(known), place[known]
        device = found.hardware | (found.vlan + 1).astype(np.uint64) << _VLAN_BIT
        pair = found.high, found.low, device, found.ttl.astype(np.uint64)
        ways.pair[place] = self._numbers(self.pairs, pair, self.pair_columns, told, found.row)
        return ways

    def _numbers(
        self, table: KeyTable, keys: tuple[U64, ...], columns: SeenColumns, told: Told, row: I64
    ) -> I64:  # fmt: skip
        """Return the numbers of keys, which packets tell, ``LEFT_OUT`` of those for which there is no room."""
        number = table.numbers_within(self._most, *keys)
        columns.begin(number, len(table), told, row)
        return np.where(number < 0, LEFT_OUT, number)

    def _observe_announcements(self, told: Told, found: FrameAddresses, number: I64) -> None:
        announced = np.flatnonzero(found.announces & (number >= 0))
        room = self._most - self.announcements.count
        self.left_out += max(len(announced) - room, 0)
        announced = announced[:room]
        row = found.row[announced]
        time_ns, frame = told.packets.ts_ns[row], row + told.first_frame
        self.announcements.add(time_ns, frame, number[announced], found.hardware[announced])

    def _observe_others(self, told: Told, seen: _Seen) -> None:
        """Take the frames that are no telegrams of lists, of hardware and of IP addresses."""
        columns = self.columns
        parts = [seen.rows(name, seen.other & (seen.numbers(name) >= 0)) for name in ("hardware", "ip")]
        row, number = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = stable_order(number, len(columns))
        row, number = row[order], number[order]
        start, stop = runs_of(number)
        if not len(start):
            return
        run, time_ns = number[start], told.packets.ts_ns[row]
        before_ns = np.roll(time_ns, 1)
        before_ns[start] = columns.last_other_ns[run]
        follows = before_ns != NEVER
        self.distances.observe(number[follows], (time_ns - before_ns)[follows], len(columns))
        self.signs.observe(number, time_ns, before_ns, len(columns))
        columns.others[run] += stop - start
        columns.last_other_ns[run] = time_ns[stop - 1]

    def _observe_alternations(self, seen: _Seen) -> None:
        """Count by how many frames another device took over an address."""
        pair, ip = seen.numbers("pair"), seen.numbers("ip")
        known = pair >= 0
        least, most = np.full(len(self.columns), len(self.pairs)), np.full(len(self.columns), NOBODY)
        np.minimum.at(least, ip[known], pair[known])
        np.maximum.at(most, ip[known], pair[known])
        # Of an address with one pair in all of the batch, one packet tells as much as all.
        simple = np.flatnonzero((least == most) & (most >= 0))
        several = known.copy()
        several[known] = (least < most)[ip[known]]
        told = seen.rows("pair", several)[1]
        owner = seen.rows("ip", several)[1]
        owner, told = np.append(simple, owner), np.append(most[simple], told)
        order = stable_order(owner, len(self.columns))
        owner, told = owner[order], told[order]
        start, stop = runs_of(owner)
        if not len(start):
            return
        before = np.roll(told, 1)
        before[start] = self.columns.pair[owner[start]]
        hardware = self.pairs.words[2] & HARDWARE_BITS
        alternates = (before >= 0) & (hardware[before] != hardware[told])
        np.add.at(self.pair_columns.alternations, told[alternates], 1)
        self.columns.pair[owner[start]] = told[stop - 1]


class _Seen:
    """The packets of a batch by kind: those with known headers, and those that stand ``alone``, rising.

    ``count`` is how many packets there are of each kind, ``other`` whether they are no telegrams of lists.
    """

    def __init__(
        self, header: I64, kind: I64, count: I64, ways: WayColumns, alone: I64, alone_ways: WayColumns, place: I64
    ) -> None:  # fmt: skip
        self._header, self._kind, self._alone = header, kind, alone
        self._ways, self._alone_ways, self._place = ways, alone_ways, place
        self.count = np.append(count, np.ones(len(alone), np.int64))
        self.other = self._of_kinds("other")

    def numbers(self, name: str) -> I64:
        """Return a column of the ways of each kind."""
        numbers: I64 = self._of_kinds(name)
        return numbers

    def _of_kinds(self, name: str) -> Any:
        return np.append(self._ways.column(name)[self._kind], self._alone_ways.column(name)[self._place])

    def rows(self, name: str, chosen: Bool) -> tuple[I64, I64]:
        """Return the packets of chosen kinds, rising, and the numbers in a column of their ways."""
        number, kinds = self.numbers(name), len(self._kind)
        own = np.flatnonzero(chosen[kinds:])
        row, told = self._alone[own], number[kinds + own]
        if chosen[:kinds].any():
            of_header = np.full(int(self._kind[-1]) + 1, NOBODY)
            of_header[self._kind[chosen[:kinds]]] = number[:kinds][chosen[:kinds]]
            found = of_header[self._header]
            known = np.flatnonzero(found >= 0)
            row, told = np.append(row, known), np.append(told, found[known])
            order = np.argsort(row)
            row, told = row[order], told[order]
        return row, told


def _are_of_lists(told: Told, row: I64) -> Bool:
    """Tell which packets of a batch hold telegrams that belong to a list."""
    varieties = told.varieties
    by_variety: Bool = np.zeros(len(varieties), np.bool_)
    on_udp = np.flatnonzero(varieties.carried.carrier == Carrier.UDP)
    by_variety[on_udp] = np.isin(varieties.telegrams_of(on_udp).header["id"], LIST_SERVICES)
    return by_variety[told.variety[row]]
