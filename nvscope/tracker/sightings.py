"""Sightings: packets of a batch by stream or by place, to be asked what comes next and what came last."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dissectors.batch import I64

NO_PACKET = np.int64(1 << 40)
"""Stands for a packet that does not exist; later than all that do."""


class Sightings:
    """Packets of a batch with a number (of a stream or a place) and the node that sent them.

    All lookups are for columns: shapes (n,). Packets are rows of the batch, -1 stands for before the first.
    """

    def __init__(self, number: I64, packet: I64, node: I64, packets: int) -> None:
        self._bits = int(packets + 2).bit_length()
        key = self._key_of(number, packet)
        self.order = np.arange(len(key)) if (key[1:] > key[:-1]).all() else np.argsort(key)
        self._key, self._node = key[self.order], node[self.order]

    def _key_of(self, number: I64, packet: I64) -> I64:
        return (number << self._bits) + packet + 1

    @cached_property
    def _behind(self) -> I64:
        """Where the next one of the same number but another node is, if that is still the same number."""
        number = self._key >> self._bits
        changes = np.flatnonzero((number[1:] != number[:-1]) | (self._node[1:] != self._node[:-1])) + 1
        ends = np.append(changes, len(self._key))
        return np.repeat(ends, np.diff(ends, prepend=0))

    def next(self, number: I64, packet: I64) -> I64:
        """Return the first packet after each given one with the number, ``NO_PACKET`` if there is none."""
        return self._packet(self._after(number, packet), number)

    def next_of_another(self, number: I64, packet: I64, node: I64) -> I64:
        """Return the same, of packets that another node than the given one sent."""
        place = self._after(number, packet)
        if not len(self._key):
            return self._packet(place, number)
        inside = np.minimum(place, len(self._key) - 1)
        own = (place < len(self._key)) & (self._node[inside] == node) & (self._key[inside] >> self._bits == number)
        return self._packet(np.where(own, self._behind[inside], place), number)

    def last_before(self, number: I64, packet: I64) -> I64:
        """Return which sighting, as numbered when they were given, is the last before each packet; -1 if none is."""
        place = np.searchsorted(self._key, self._key_of(number, packet)) - 1
        if not len(self._key):
            return place
        inside = np.maximum(place, 0)
        known = (place >= 0) & (self._key[inside] >> self._bits == number)
        return np.where(known, self.order[inside], -1)

    def _after(self, number: I64, packet: I64) -> I64:
        return np.searchsorted(self._key, self._key_of(number, packet), "right")

    def _packet(self, place: I64, number: I64) -> I64:
        if not len(self._key):
            return np.full(len(place), NO_PACKET)
        inside = np.minimum(place, len(self._key) - 1)
        known = (place < len(self._key)) & (self._key[inside] >> self._bits == number)
        return np.where(known, (self._key[inside] & ((1 << self._bits) - 1)) - 1, NO_PACKET)
