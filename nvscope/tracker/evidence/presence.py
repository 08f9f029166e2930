"""Presence: who is there, from when to when, how often they are heard, and which addresses are those of one device."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from dissectors.addresses import FrameAddresses, addresses_of
from dissectors.batch import I64, U64, Bool
from dissectors.keys import KeyTable
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.tracker.evidence.questions import Questions
from nvscope.tracker.evidence.signs import MOST_SPANS, SignsOfLife
from nvscope.tracker.evidence.waiting import Heard, Waiting

MOST_ADDRESSES = 1 << 16
"""So many addresses are kept, and so many pairs of them, and announcements; what is left out is counted."""

NEVER = np.iinfo(np.int64).min

NOBODY, LEFT_OUT = -1, -2
"""In place of the number of an address that is not told, and of one for which there was no room."""

HARDWARE, IP = 0, 1
"""The first word of the key of an address; the others are its halves, of a hardware address 0 and the address."""

_VLAN_BIT = np.uint64(48)
HARDWARE_BITS = (np.uint64(1) << _VLAN_BIT) - np.uint64(1)

BY_ARP, BY_ARP_ANSWER = 256, 257
"""In place of a time to live, of ARP messages that an address sends: those of its own accord, and its answers."""


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

    def begin(self, number: I64, rows: int, heard: Heard, row: I64) -> None:
        """Let rows that are new begin with packets that were heard, rising; there are so many then."""
        before = len(self)
        self.resize(rows)
        new = np.flatnonzero(number >= before)[::-1]
        # Of several, the first one is what stays.
        self.first_ns[number[new]] = heard.times_ns(row[new])
        self.first_frame[number[new]] = heard.frames(row[new])


class AddressColumns(SeenColumns):
    """One row an address; ``others`` are its frames that are no telegrams of lists, ``pair`` is the last one it had.

    ``last_other_ns`` is ``NEVER``, and ``pair`` ``NOBODY``, before the first, and after nobody has listened. ``shared``
    are IP addresses with frames of several hardware addresses.
    """

    others: I64
    last_other_ns: I64
    pair: I64
    shared: Bool
    COLUMNS: ClassVar = SeenColumns.COLUMNS | {
        "others": (np.int64(0), 1), "last_other_ns": (np.int64(NEVER), 1), "pair": (np.int64(NOBODY), 1),
        "shared": (np.False_, 1),
    }  # fmt: skip


class PairColumns(SeenColumns):
    """One row an IP address with the device that it is told by.

    ``alternations`` counts its frames that follow one of the same IP address from another hardware address. Of shared
    addresses, ``last_ns`` is the time of its last frame.
    """

    alternations: I64
    last_ns: I64
    COLUMNS: ClassVar = SeenColumns.COLUMNS | {"alternations": (np.int64(0), 1), "last_ns": (np.int64(NEVER), 1)}


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
    """An observer of all frames, which takes many batches at a time: ``settle`` before looking at it.

    ``addresses`` number the hardware and IP addresses that sent some, which are the rows of ``columns``; ``pairs``
    number (upper half, lower half, hardware address with VLAN + 1 above it, time to live, or ``BY_ARP`` and
    above), the rows of ``pair_columns``. ``signs`` are when an address's frames that are no telegrams of lists were, by
    the rows of ``columns``, ``questions`` who looked for whom. ``claims`` are the IP addresses with the hardware
    addresses that ARP told of them (upper half, lower half, hardware address). ``left_out`` counts the frames of
    addresses and pairs for which there was no room.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_ADDRESSES, most_spans: int = MOST_SPANS) -> None:
        self._most = most
        self.addresses, self.columns = KeyTable(3), AddressColumns()
        self.pairs, self.pair_columns = KeyTable(4), PairColumns()
        # IP addresses with hardware addresses, and which of them each pair is of.
        self._devices = KeyTable(3)
        self._device_of: I64 = np.empty(0, np.int64)
        self.signs = SignsOfLife(most_spans)
        self.questions = Questions(most, most_spans)
        self.announcements = Announcements()
        self.left_out = 0
        # Packets with the same headers come by the same way: the first one is looked at for all, by their number.
        self._ways = WayColumns()
        self._ways.resize(1)
        self._waiting = Waiting()

    def throw_away(self) -> None:
        """Throw away the spans for which there is no room: what is kept does not hang on when that is done."""
        self.signs.throw_away()
        self.questions.spans.throw_away()

    @property
    def all_left_out(self) -> int:
        """How much there was no room for in all."""
        return self.left_out + self.signs.left_out + self.questions.left_out + self.questions.spans.left_out

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if self._waiting.is_full or not self._waiting.fits(told):
            self.settle()
        if not self._waiting.fits(told):
            self._waiting, self._ways = Waiting(), WayColumns()
            self._ways.resize(1)
        if told.is_deaf:
            self.settle()
            self.columns.last_other_ns[:] = NEVER
            self.columns.pair[:] = NOBODY
            self.questions.begin_anew()
        if len(told):
            self._waiting.add(told)

    def settle(self) -> None:
        """Count what waits to be counted."""
        heard = self._waiting.take()
        if heard is None:
            return
        ways = self._look_at(heard)
        count = heard.count
        self._ways.resize(len(count))
        self._ways.put(heard.header, ways)
        alone = np.flatnonzero(heard.header == 0)
        kind = np.flatnonzero(count[1:]) + 1
        seen = _Seen(heard, kind, count[kind], self._ways, heard.looked_at[alone], ways, alone)
        for name, columns in (("hardware", self.columns), ("ip", self.columns), ("pair", self.pair_columns)):
            number = seen.numbers(name)
            columns.add(number, seen.count)
            self.left_out += int(seen.count[number == LEFT_OUT].sum())
        self._observe_others(heard, seen)
        self._observe_alternations(heard, seen)

    def _look_at(self, heard: Heard) -> WayColumns:
        """Return by which ways the packets come that are looked at, having numbered what is new of them."""
        found = addresses_of(heard.heads)
        ways = WayColumns()
        ways.resize(len(heard.looked_at))
        ways.column("other")[:] = heard.other
        place, row = found.row, heard.looked_at[found.row]
        if found.sought.any():
            self.questions.observe(found, heard.times_ns(row))
        known = np.flatnonzero(found.hardware)
        nothing = np.zeros(len(known), np.uint64)
        keys = nothing + np.uint64(HARDWARE), nothing, found.hardware[known]
        ways.hardware[place[known]] = self._numbers(self.addresses, keys, self.columns, heard, row[known])
        known = np.flatnonzero(found.has_ip)
        keys = np.full(len(known), IP, np.uint64), found.high[known], found.low[known]
        number = self._numbers(self.addresses, keys, self.columns, heard, row[known])
        ways.ip[place[known]] = number
        found, place, row = found.take(known), place[known], row[known]
        self._observe_announcements(heard, found, row, number)
        known = np.flatnonzero((found.hardware != 0) & (number >= 0))
        found, place, row = found.take(known), place[known], row[known]
        device = found.hardware | (found.vlan + 1).astype(np.uint64) << _VLAN_BIT
        # What ARP says is about an address, and has no time to live.
        time_to_live = np.where(found.ttl < 0, BY_ARP + found.answers, found.ttl).astype(np.uint64)
        pair = found.high, found.low, device, time_to_live
        ways.pair[place] = self._numbers(self.pairs, pair, self.pair_columns, heard, row)
        high, low, device, _ = (word[len(self._device_of) :] for word in self.pairs.words)
        self._device_of = np.append(self._device_of, self._devices.numbers(high, low, device & HARDWARE_BITS))
        return ways

    def _numbers(
        self, table: KeyTable, keys: tuple[U64, ...], columns: SeenColumns, heard: Heard, row: I64
    ) -> I64:  # fmt: skip
        """Return the numbers of keys, which packets tell, ``LEFT_OUT`` of those for which there is no room."""
        number = table.numbers_within(self._most, *keys)
        columns.begin(number, len(table), heard, row)
        return np.where(number < 0, LEFT_OUT, number)

    def _observe_announcements(self, heard: Heard, found: FrameAddresses, row: I64, number: I64) -> None:
        announced = np.flatnonzero(found.announces & (number >= 0))
        room = self._most - self.announcements.count
        self.left_out += max(len(announced) - room, 0)
        announced = announced[:room]
        row = row[announced]
        self.announcements.add(heard.times_ns(row), heard.frames(row), number[announced], found.hardware[announced])

    def _observe_others(self, heard: Heard, seen: _Seen) -> None:
        """Take the frames that are no telegrams of lists, of hardware and of IP addresses."""
        rows, place = seen.rows(seen.other)
        times_ns = heard.times_ns(rows)
        for name in ("hardware", "ip"):
            number, time_ns = seen.numbers(name).take(place), times_ns
            known = number >= 0
            if not known.all():
                number, time_ns = number[known], time_ns[known]
            self._observe_others_of(number, time_ns)

    def _observe_others_of(self, number: I64, time_ns: I64) -> None:
        """Take frames of addresses by number, as they came; none is of a list."""
        columns = self.columns
        order = stable_order(number, len(columns))
        number, time_ns = number.take(order), time_ns.take(order)
        start, stop = runs_of(number)
        if not len(start):
            return
        run = number[start]
        before_ns = np.empty_like(time_ns)
        before_ns[1:] = time_ns[:-1]
        before_ns[start] = columns.last_other_ns[run]
        self.signs.observe(number, time_ns, before_ns, len(columns))
        columns.others[run] += stop - start
        columns.last_other_ns[run] = time_ns[stop - 1]

    def _observe_alternations(self, heard: Heard, seen: _Seen) -> None:
        """Count by how many frames another device took over an address."""
        pair, ip, device_of = seen.numbers("pair"), seen.numbers("ip"), self._device_of
        known = pair >= 0
        least, most = np.full(len(self.columns), len(self.pairs)), np.full(len(self.columns), NOBODY)
        np.minimum.at(least, ip[known], device_of[pair[known]])
        np.maximum.at(most, ip[known], device_of[pair[known]])
        shared = self.columns.column("shared")
        shared |= least < most
        # Of an address with one device in all that is counted now, one packet tells as much as all.
        simple = np.flatnonzero((least == most) & (most >= 0) & ~shared)
        before = self.columns.pair[simple]
        other = (before >= 0) & (device_of[before] != most[simple])
        shared[simple[other]] = True
        simple = simple[~other]
        of_address = np.full(len(self.columns), NOBODY)
        of_address[ip[known]] = pair[known]
        several = known.copy()
        several[known] = shared[ip[known]]
        row, place = seen.rows(several)
        self.pair_columns.last_ns[pair[place]] = heard.times_ns(row)  # of several frames, the last one is what stays
        owner, told = np.append(simple, ip[place]), np.append(of_address[simple], pair[place])
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
    """Packets by kind: those with known headers, and those that stand ``alone``, rising.

    ``count`` is how many packets there are of each kind, ``other`` whether they are no telegrams of lists.
    """

    def __init__(
        self, heard: Heard, kind: I64, count: I64, ways: WayColumns, alone: I64, alone_ways: WayColumns, place: I64
    ) -> None:  # fmt: skip
        self._heard, self._kind, self._alone = heard, kind, alone
        self._ways, self._alone_ways, self._place = ways, alone_ways, place
        self.count = np.append(count, np.ones(len(alone), np.int64))
        self.other = self._of_kinds("other")

    def numbers(self, name: str) -> I64:
        """Return a column of the ways of each kind."""
        numbers: I64 = self._of_kinds(name)
        return numbers

    def _of_kinds(self, name: str) -> Any:
        return np.append(self._ways.column(name)[self._kind], self._alone_ways.column(name)[self._place])

    def rows(self, chosen: Bool) -> tuple[I64, I64]:
        """Return the packets of chosen kinds, rising, and the place of the kind of each."""
        kinds = len(self._kind)
        own = np.flatnonzero(chosen[kinds:])
        row, told = self._alone[own], kinds + own
        if chosen[:kinds].any():
            place_of = np.full(len(self._heard.count), NOBODY)
            place_of[self._kind[chosen[:kinds]]] = np.flatnonzero(chosen[:kinds])
            known, header = self._heard.of_headers(place_of >= 0)
            if not len(own):
                return known, place_of[header]
            row, told = np.append(row, known), np.append(told, place_of[header])
            order = np.argsort(row)
            row, told = row[order], told[order]
        return row, told
