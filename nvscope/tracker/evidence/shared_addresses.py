"""SharedAddresses: who sends from an IP address that several hardware addresses have, and how each of them counts.

Two devices with one address are told from one device whose frames come by two ways: each counts for itself, in the
telegrams of lists, or in its requests to the Parameter Manager.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from dissectors.addresses import addresses_of
from dissectors.batch import I64, U8, U64, Bool, LinkType
from dissectors.carried import Carried, Carrier
from dissectors.keys import KeyTable, first_rows_from
from dissectors.layout import gather_bytes
from dissectors.netvar import PARAMETER_REQUESTS, Fault
from dissectors.varieties import Varieties
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import distinct, runs_of, stable_order
from nvscope.engine.told import Told
from nvscope.tracker.parameter.asked_ports import source_ports
from nvscope.tracker.steps import EARLY_WRAPS

MOST_SEQUENCES = 1 << 16
"""So many sequences of counters are kept, and so many devices; telegrams of others are counted."""

ALL_DEVICES = np.uint64(0)
ALL_LISTS = np.uint64(1 << 63)
"""In place of a hardware address, and of a (list, SubIndex): the sequence is that of all of them together."""

OF_REQUESTS = np.uint64(1 << 62)
ALL_REQUESTS = ALL_LISTS | OF_REQUESTS
"""What requests have in place of a (list, SubIndex): a bit beside what is asked for, and all requests together."""

_NONE = -1
_PORT_BIT, _PORT_BITS = np.uint64(32), np.uint64(0xFFFF << 32)


class SequenceColumns(KeyedColumns):
    """One row a sequence of counters: its steps, and how many of these were to the next one; ``last`` is the Counter.

    Telegrams that are repeated are no step.
    """

    last: I64
    steps: I64
    regular: I64
    COLUMNS: ClassVar = {"last": (np.int64(_NONE), 1), "steps": (np.int64(0), 1), "regular": (np.int64(0), 1)}


class DeviceColumns(KeyedColumns):
    """One row an IP address with a hardware address: its data telegrams from the first change of hardware on.

    ``repeated`` of them equal the one before in their (list, SubIndex).
    """

    telegrams: I64
    repeated: I64
    COLUMNS: ClassVar = {"telegrams": (np.int64(0), 1), "repeated": (np.int64(0), 1)}


class _AddressColumns(KeyedColumns):
    """One row an IP address: the hardware address that it had first, and whether it has had another one, too."""

    first: U64
    shared: Bool
    COLUMNS: ClassVar = {"first": (np.uint64(0), 1), "shared": (np.False_, 1)}


class _WayColumns(KeyedColumns):
    """One row a number of headers: the IP address that its telegrams have, and their hardware address."""

    address: I64
    hardware: U64
    COLUMNS: ClassVar = {"address": (np.int64(_NONE), 1), "hardware": (np.uint64(0), 1)}


class SharedAddresses:
    """An observer of data telegrams and requests on Ethernet, which keeps those of IP addresses of several devices.

    ``addresses`` number IP addresses (upper half, lower half), all there are. ``sequences`` number (IP address,
    hardware address or ``ALL_DEVICES``, (port, list, SubIndex) or ``ALL_LISTS``), the rows of ``columns``; ``devices``
    number (IP address, hardware address), those of ``device_columns``: of shared addresses, from the first telegram on
    that comes from another device. Requests have a sequence for each parameter of a partner that they ask for from one
    port, with ``OF_REQUESTS``, and ``ALL_REQUESTS``: one device with two cables, each of which carries what goes to
    some partners, has none in common on both. ``left_out`` counts what there was no room for.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, most: int = MOST_SEQUENCES) -> None:
        self._most = most
        self.addresses, self._known = KeyTable(), _AddressColumns()
        self.sequences, self.columns = KeyTable(3), SequenceColumns()
        self.devices, self.device_columns = KeyTable(), DeviceColumns()
        self._flows = KeyTable(3)
        self._last: dict[int, tuple[int, bytes]] = {}
        self.left_out = 0
        # Packets with the same headers come by the same way: the first one is looked at for all, by their number.
        self._varieties: Varieties | None = None
        self._ways = _WayColumns()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if told.varieties is not self._varieties:
            self._varieties, self._ways = told.varieties, _WayColumns()
            self._ways.resize(1)
        if not len(told):
            return
        header, known = told.batch.header, len(self._ways)
        alone = told.without_header
        alone = alone[(told.packets.link[alone] == LinkType.ETHERNET) & self._are_counted(told, alone)]
        new = np.empty(0, np.int64)
        if len(told.header_counts) > known:
            self._ways.resize(len(told.header_counts))
            new = first_rows_from(header, known, len(self._ways))
            new = new[self._are_counted(told, new)]
        row = np.sort(np.append(alone, new))
        before = self._known.column("shared").copy()
        row, address, hardware = self._look_at(told, row)
        self._ways.address[header[row]], self._ways.hardware[header[row]] = address, hardware
        self._ways.address[0] = _NONE
        shared = self._known.column("shared")
        if shared.any():
            single = header[row] == 0
            self._observe_shared(
                told,
                (row[single], address[single], hardware[single]),
                np.append(before, np.zeros(len(shared) - len(before), np.bool_)),
            )

    def _are_counted(self, told: Told, row: I64) -> Bool:
        """Tell which packets hold data telegrams on UDP, or requests of the Parameter Manager."""
        varieties, variety = told.varieties, told.variety[row]
        on_udp = varieties.carried.carrier[variety] == Carrier.UDP
        are: Bool = varieties.carried.is_data[variety] & on_udp
        others = np.flatnonzero(on_udp & ~are)
        if len(others):
            part, common = varieties.part[variety[others]], varieties.telegrams
            asks = np.isin(common.header["id"][part], PARAMETER_REQUESTS)
            are[others] = asks & (common.fault[part] == Fault.NONE)
        return are

    def _look_at(self, told: Told, row: I64) -> tuple[I64, I64, U64]:
        """Return who sent some packets, rising, of which that is known, and note addresses of several devices."""
        if not len(row):
            return row, row, row.astype(np.uint64)
        found = addresses_of(told.packets, row)
        found = found.take(found.has_ip & (found.ttl >= 0) & (found.hardware != 0))
        before = len(self.addresses)
        address = self.addresses.numbers_within(self._most, found.high, found.low)
        self.left_out += int(np.count_nonzero(address < 0))
        row, hardware = found.row[address >= 0], found.hardware[address >= 0]
        address = address[address >= 0]
        self._known.resize(len(self.addresses))
        new = np.flatnonzero(address >= before)[::-1]
        self._known.first[address[new]] = hardware[new]  # of several, the first one is what stays
        self._known.shared[address[hardware != self._known.first[address]]] = True
        return row, address, hardware

    def _observe_shared(self, told: Told, alone: tuple[I64, I64, U64], before: Bool) -> None:
        """Take the telegrams of shared addresses: those with known headers, and those that stand alone.

        Of addresses that were not shared ``before``, only what comes from the first change on.
        """
        shared, way = self._known.column("shared"), self._ways.column("address")
        chosen = np.append(shared, False)[way]  # those without an address have the last place
        row = np.flatnonzero(chosen[told.batch.header])
        own = shared[alone[1]]
        address = np.append(way[told.batch.header[row]], alone[1][own])
        hardware = np.append(self._ways.hardware[told.batch.header[row]], alone[2][own])
        row = np.append(row, alone[0][own])
        order = np.argsort(row, kind="stable")
        row, address, hardware = row[order], address[order], hardware[order]
        other = np.flatnonzero(hardware != self._known.first[address])
        begin = np.where(before, 0, len(told))
        np.minimum.at(begin, address[other], row[other])
        counts = row >= begin[address]
        self._observe_rows(told, row[counts], address[counts].astype(np.uint64), hardware[counts])

    def _observe_rows(self, told: Told, row: I64, owner: U64, hardware: U64) -> None:
        """Count telegrams of shared addresses, rising."""
        carried, variety = told.varieties.carried, told.variety[row]
        place, asks = _places(carried, variety), ~carried.is_data[variety]
        # Who asks the same again and again, with one Counter, sends nothing on: requests are of no device here.
        device, flow = np.zeros(len(row), np.int64), np.zeros(len(row), np.int64)
        device[~asks] = self.devices.numbers_within(self._most, owner[~asks], hardware[~asks])
        self.device_columns.resize(len(self.devices))
        flow[asks] = self._flows_of(told, row[asks])
        place[asks] = place[asks] & ~_PORT_BITS | OF_REQUESTS | flow[asks].astype(np.uint64) << _PORT_BIT
        stream = self.sequences.numbers_within(self._most, owner, np.full(len(row), ALL_DEVICES), place)
        self.columns.resize(len(self.sequences))
        room = (stream >= 0) & (device >= 0) & (flow >= 0)
        self.left_out += int(np.count_nonzero(~room))
        row, place, owner, hardware, device = row[room], place[room], owner[room], hardware[room], device[room]
        repeated, asks = self._repeated(told, row, stream[room]), asks[room]
        for column, own in (("telegrams", device[~asks]), ("repeated", device[repeated & ~asks])):
            np.add.at(self.device_columns.column(column), own, 1)
        new = ~repeated
        counter = told.counter[row[new]].astype(np.int64)
        for devices in (hardware[new], np.full(len(counter), ALL_DEVICES)):
            for places in (place[new], np.where(asks[new], ALL_REQUESTS, ALL_LISTS)):
                self._count(counter, owner[new], devices, places)

    def _flows_of(self, told: Told, row: I64) -> I64:
        """Return numbers of what requests come from and go to: a port, an address and its port."""
        part = told.varieties.part[told.variety[row]]
        datagram = told.varieties.telegrams.datagram.take(part)
        from_port = source_ports(told.packets.data, told.packets.offset[row] + datagram.payload).astype(np.uint64)
        ports = from_port << np.uint64(16) | datagram.destination_port.astype(np.uint64)
        return self._flows.numbers_within(self._most, datagram.destination_hi, datagram.destination_lo, ports)

    def _count(self, counter: I64, *words: U64) -> None:
        """Let sequences take a step for each telegram."""
        number = self.sequences.numbers_within(self._most, *words)
        known = number >= 0
        self.left_out += int(np.count_nonzero(~known))
        columns = self.columns
        columns.resize(len(self.sequences))
        number, now = number[known], counter[known]
        order = stable_order(number, len(columns))
        number, now = number[order], now[order]
        start, stop = runs_of(number)
        if not len(start):
            return
        before = np.roll(now, 1)
        before[start] = columns.last[number[start]]
        steps = before != _NONE
        regular = steps & (((now - before) & 0xFFFF == 1) | ((now == 0) & np.isin(before, EARLY_WRAPS)))
        columns.steps[number[start]] += np.add.reduceat(steps.astype(np.int64), start)
        columns.regular[number[start]] += np.add.reduceat(regular.astype(np.int64), start)
        columns.last[number[start]] = now[stop - 1]

    def _repeated(self, told: Told, row: I64, stream: I64) -> Bool:
        """Tell which data telegrams equal the one before in their stream, whoever sent it, as far as both are there."""
        carried, variety, counter = told.varieties.carried, told.variety[row], told.counter[row]
        size, at = carried.captured_bytes[variety], told.packets.offset[row] + carried.at[variety]
        order = stable_order(stream, len(self.columns))
        start, stop = runs_of(stream[order])
        again = np.zeros(len(row), np.bool_)
        inner = np.ones(len(row), np.bool_)
        inner[start] = False
        place = np.flatnonzero(inner)
        for column in (carried.items[variety], carried.size_bytes[variety], size, counter):
            place = place[column[order[place]] == column[order[place - 1]]]
        for length in distinct(size[order[place]]).tolist():
            now = place[size[order[place]] == length]
            data, before = (_bytes_at(told.packets.data, at[order[some]], length) for some in (now, now - 1))
            again[order[now]] = (data == before).all(axis=1)

        def look(one: int) -> tuple[int, bytes]:
            return int(counter[one]), told.packets.data[int(at[one]) : int(at[one] + size[one])].tobytes()

        for first, last in zip(order[start].tolist(), order[stop - 1].tolist(), strict=True):
            again[first] = self._last.get(int(stream[first])) == look(first)
            self._last[int(stream[first])] = look(last)
        return again


def _places(carried: Carried, variety: I64) -> U64:
    """Return which (port, list, SubIndex) telegrams are of, as one word each."""
    word = carried.port[variety] << 32 | carried.identifier[variety] << 16 | carried.subindex[variety]
    place: U64 = word.astype(np.uint64)
    return place


def _bytes_at(data: U8, at: I64, size: int) -> U8:
    """Return the bytes at some places, shape (n, ``size``)."""
    gathered: U8 = gather_bytes(data, at, size).view(np.uint8).reshape(len(at), size)
    return gathered
