"""SharedAddress: an IP address that several devices have, what tells them from one, and whether they use it in turns.

One device whose frames come by two ways (a router, a mirror of both its sides, two cables), one that got another
device's address, a pair of which the one takes over from the other, and a computer that answers ARP for all of its
addresses on each of its cards are none of these; nor is 0.0.0.0, which all have that have no address.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dissectors import address
from dissectors.headers import IPV4_LOW
from dissectors.keys import KeyTable
from nvscope.engine.runs import distinct
from nvscope.tracker.evidence.presence import BY_ARP, BY_ARP_ANSWER, HARDWARE_BITS, IP, Presence
from nvscope.tracker.evidence.shared_addresses import ALL_DEVICES, ALL_LISTS, OF_REQUESTS, SharedAddresses

LEAST_ALTERNATIONS = 3
_MOST_IPS = 2  # a hardware address with more of them is a router's
_REPEATED_PERCENT = 80
_REGULAR_PERCENT = 90
_LEAST_STEPS = 3

_TURNS_EACH = 5
_TURNS_PERCENT = 10
"""A pair that takes over from each other does so a few times, and for long: its turns are few beside its frames."""

_UNSPECIFIED, _HARDWARE_BYTES, _VLAN_SHIFT = IPV4_LOW, 6, 48

_VIRTUAL = ((0x00_00_5E_00_01, 40), (0x00_00_5E_00_02, 40), (0x00_00_0C_07_AC, 40), (0x00_00_0C_9F_F, 36))
"""Begins, in bits, of hardware addresses that redundant devices have beside their own: VRRP, CARP and HSRP."""

_MOST_HOPS = 8
"""By so much less a time to live is that of the same frame behind some routers; those of systems are further apart."""


class Device(NamedTuple):
    """A hardware address that sends from an address others have, too; ``alternations`` are its turns behind others.

    ``vlans`` are the numbers in the outermost tags of its frames, -1 where there is none. ``claims``: it tells the
    address by ARP of its own accord.
    """

    hardware: int
    first_frame: int
    first_ns: int
    last_ns: int
    alternations: int
    frames: int
    times_to_live: Collection[int]
    vlans: Collection[int]
    claims: bool


class SharedAddress(NamedTuple):
    """The devices that have the address of a node, by their first frames, and what tells them from one device.

    ``by_counters``: the Counters of their data telegrams do.
    """

    node: int
    devices: Sequence[Device]
    told_by: Sequence[str]
    by_counters: bool

    @property
    def alternations(self) -> int:
        """How many turns they took in all."""
        return sum(one.alternations for one in self.devices)

    @property
    def are_apart(self) -> bool:
        """Whether each is in VLANs of its own: networks that have the same addresses, as those of like machines."""
        vlans = [one for device in self.devices for one in device.vlans]
        return len(vlans) == len({*vlans})

    @property
    def is_interleaved(self) -> bool:
        """Whether they use it at the same time, so that neither a router nor a change of hands explains it."""
        if self.are_apart:
            return False
        rarest = min(self.devices, key=lambda one: one.frames)
        if min(one.alternations for one in self.devices) < _TURNS_EACH:
            return False
        if 100 * rarest.alternations < _TURNS_PERCENT * rarest.frames:
            return False
        return self.by_counters or not _is_behind_a_router(self.devices)


def _is_behind_a_router(devices: Sequence[Device]) -> bool:
    """Tell whether frames of one device look as if those of another had passed routers."""
    return any(
        0 < abs(one - other) <= _MOST_HOPS
        for place, device in enumerate(devices)
        for further in devices[place + 1 :]
        for one in device.times_to_live
        for other in further.times_to_live
    )


def shared_addresses(
    presence: Presence, shared: SharedAddresses, nodes: Mapping[str, int],
    addresses_of: Mapping[int, Collection[object]],
) -> Sequence[SharedAddress]:  # fmt: skip
    """Return the addresses of ``nodes`` that several devices have, by node; ``presence`` has settled.

    ``nodes`` are the numbers of all who send lists, speak of parameters or show pages, by the text of their address.
    ``addresses_of`` are the IP addresses that each hardware address sends from.
    """
    numbers = np.flatnonzero(presence.columns.shared)
    if not len(numbers):
        return ()
    pairs, found = _Pairs(presence, addresses_of), []
    for number in numbers.tolist():
        kind, high, low = (int(words[number]) for words in presence.addresses.words)
        node = nodes.get(address.text(high, low)) if kind == IP and low != _UNSPECIFIED else None
        devices = [] if node is None else _devices(presence, shared, number, pairs)
        if node is None or len(devices) < 2 or sum(one.alternations for one in devices) < LEAST_ALTERNATIONS:
            continue
        told, by_counters = _told_by(presence, shared, number, devices)
        if told:
            found.append(SharedAddress(node, devices, told, by_counters))
    return sorted(found, key=lambda one: one.node)


def addresses_by_hardware(presence: Presence) -> Mapping[int, Collection[tuple[int, int]]]:
    """Return the IP addresses, as upper and lower half, whose packets came from each hardware address."""
    high, low, device, _ = presence.pairs.words
    owners: dict[int, set[tuple[int, int]]] = {}
    for one, *halves in zip((device & HARDWARE_BITS).tolist(), high.tolist(), low.tolist(), strict=True):
        owners.setdefault(one, set()).add((halves[0], halves[1]))
    return owners


def hardware_text(hardware: int) -> str:
    """Return a hardware address as it is written: ``02:00:00:00:00:01``."""
    return hardware.to_bytes(_HARDWARE_BYTES, "big").hex(":")


class _Pairs:
    """Which addresses came from which hardware, looked up once for all: a flood makes very many of them."""

    def __init__(self, presence: Presence, addresses_of: Mapping[int, Collection[object]]) -> None:
        high, low, self.device, _ = presence.pairs.words
        self._hardware = (self.device & HARDWARE_BITS).tolist()
        self._rows: dict[tuple[int, int], list[int]] = defaultdict(list)
        for row, place in enumerate(zip(high.tolist(), low.tolist(), strict=True)):
            self._rows[place].append(row)
        self._routers = {one for one, several in addresses_of.items() if len(several) > _MOST_IPS}

    def of(self, high: int, low: int) -> dict[int, list[int]]:
        """Return the rows of an address by hardware address, routers left out."""
        rows: dict[int, list[int]] = defaultdict(list)
        for row in self._rows[high, low]:
            if self._hardware[row] not in self._routers:
                rows[self._hardware[row]].append(row)
        return rows


def _devices(presence: Presence, shared: SharedAddresses, number: int, pairs: _Pairs) -> list[Device]:
    """Return the devices that have an address, by their first frames: no routers, and none that only repeat or answer.

    A computer with two cards in one network answers who looks for an address of it on both.
    """
    _, high, low = (int(words[number]) for words in presence.addresses.words)
    time_to_live = presence.pairs.words[3]
    found = []
    for own, of_pairs in pairs.of(high, low).items():
        if _repeats(shared, high, low, own):
            continue
        columns = presence.pair_columns
        first = min(of_pairs, key=lambda row: int(columns.first_frame[row]))
        told_by = {int(time_to_live[row]) for row in of_pairs}
        if told_by == {BY_ARP_ANSWER}:
            continue
        lives = {one for one in told_by if one < BY_ARP}
        found.append(
            Device(
                own, int(columns.first_frame[first]), int(columns.first_ns[first]),
                max(int(columns.last_ns[row]) for row in of_pairs),
                sum(int(columns.alternations[row]) for row in of_pairs),
                sum(int(columns.count[row]) for row in of_pairs), lives,
                {(int(pairs.device[row]) >> _VLAN_SHIFT) - 1 for row in of_pairs}, BY_ARP in told_by,
            )
        )  # fmt: skip
    return sorted(found, key=lambda one: one.first_frame)


def _repeats(shared: SharedAddresses, high: int, low: int, hardware: int) -> bool:
    """Tell whether a device only sends again what another one has sent."""
    device = _find(shared.devices, _find(shared.addresses, high, low), hardware)
    if device < 0:
        return False
    telegrams, repeated = (int(shared.device_columns.column(name)[device]) for name in ("telegrams", "repeated"))
    return bool(telegrams) and 100 * repeated >= _REPEATED_PERCENT * telegrams


def _find(table: KeyTable, *words: int) -> int:
    """Return the number of one key, -1 where there is none."""
    if any(word < 0 for word in words):
        return -1
    return int(table.find(*(np.array([word], np.uint64) for word in words))[0])


def _told_by(
    presence: Presence, shared: SharedAddresses, number: int, devices: list[Device]
) -> tuple[Sequence[str], bool]:  # fmt: skip
    """Return what tells several devices from one whose frames come by two ways, and whether Counters of lists do."""
    told = []
    high, low = (int(words[number]) for words in presence.addresses.words[1:])
    known = _find(shared.addresses, high, low)
    lists, requests = (_Counting(shared, known, devices, bit) for bit in (np.uint64(0), OF_REQUESTS))
    if lists.are_several:
        told.append("the counters of each of them are regular, those of both together are not")
    elif requests.are_several and not lists.are_one and not _is_behind_a_router(devices):
        told.append("the counters of the requests of each of them are regular, those of both together are not")
    # Who only answers ARP may do so for another one: a router, or a computer on each of its cards.
    claiming = sum(one.claims and not _is_virtual(one.hardware) for one in devices)
    if claiming >= 2 and not lists.are_one and not requests.are_one:
        told.append("ARP tells both hardware addresses for it")
    return told, lists.are_several


def _is_virtual(hardware: int) -> bool:
    return any(hardware >> (8 * _HARDWARE_BYTES - bits) == begin for begin, bits in _VIRTUAL)


class _Counting:
    """How devices with one address count in the telegrams of their lists, or, by the ``bit``, in their requests.

    ``are_several``: each counts for itself. ``are_one``: what counts regularly over both of them, and not over each, is
    one device that sends over two cables.
    """

    def __init__(self, shared: SharedAddresses, number: int, devices: Sequence[Device], bit: np.uint64) -> None:
        owner, device, place = shared.sequences.words
        row = np.flatnonzero((owner == np.uint64(max(number, 0))) & (place & OF_REQUESTS == bit) & (number >= 0))
        self._device, self._is_whole = device[row], place[row] & ALL_LISTS != 0
        self._steps, self._regular = (shared.columns.column(name)[row] for name in ("steps", "regular"))
        each = [self._regular_of(one.hardware) for one in devices]
        together = self._regular_of(int(ALL_DEVICES))
        is_regular = together is not None and any(together)
        several = sum(one is not None and any(one) for one in each) >= 2
        self.are_several = several and together is not None and not is_regular
        self.are_one = is_regular and not any(one is None or any(one) for one in each)
        if bit and self.are_several:
            # What goes to other partners, or from another program, may go over the other cable of one device.
            own = ~self._is_whole & (self._steps > 0) & np.isin(self._device, [one.hardware for one in devices])
            self.are_several = len(distinct(place[row][own])) < int(np.count_nonzero(own))

    def _regular_of(self, hardware: int) -> tuple[bool, bool] | None:
        """Tell whether a device counts regularly by stream, and over all that it sends; None where nobody knows."""
        found = []
        for chosen in (self._device == hardware) & ~self._is_whole, (self._device == hardware) & self._is_whole:
            steps, regular = int(self._steps[chosen].sum()), int(self._regular[chosen].sum())
            found.append(steps >= _LEAST_STEPS and 100 * regular >= _REGULAR_PERCENT * steps)
            if not steps:
                return None
        return found[0], found[1]
