"""PDOs: network variables on CAN, frames that stand for the telegrams of lists.

A frame has no header. Which list it belongs to, and as which part of it, follows from its identifier: the first frame
of a list has the list's own, further ones those that follow (Network Functionality in CoDeSys V2.3, section 2.3).
Without a definition, every identifier is a list alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from msgspec import Struct, field

from dissectors.batch import U64, Bool
from dissectors.can import frame as can
from dissectors.can.frame import CanBatch, Fault

EXTENDED = can.EXTENDED.mask
"""The bit by which the number of an extended identifier differs from that of a standard one."""


class PdoPart(NamedTuple):
    """What a COB-ID carries: a list, by its own COB-ID, and which part of it."""

    cob_id: int
    subindex: int = 0


class PdoList(NamedTuple):
    """What is told of a list: of how many frames it is, and at which interval it is sent (0: unknown)."""

    frames: int
    interval_ns: int = 0


def channel_name(names: Sequence[str], number: int) -> str:
    """Return what a channel is called, given the names that are known: can0 and so on where there is none."""
    return (names[number] if number < len(names) else "") or f"can{number}"


def _no_names() -> Sequence[str]:
    return ()


class PdoRules(Struct, frozen=True):
    """Which lists are on which COB-IDs.

    ``parts`` are by channel and standard identifier, ``lists`` by channel and that of their first frame; a channel of
    "" stands for all that are not named. ``names`` returns what channels are called, by number, as far as that is
    known.
    """

    parts: Mapping[tuple[str, int], PdoPart] = field(default_factory=dict)
    lists: Mapping[tuple[str, int], PdoList] = field(default_factory=dict)
    names: Callable[[], Sequence[str]] = _no_names

    def channel(self, number: int) -> str:
        """Return the name of a channel."""
        return channel_name(self.names(), number)

    def part_of(self, channel: int, identifier: int) -> PdoPart:
        """Return what an identifier of a channel carries; extended ones have the bit ``EXTENDED``."""
        if self.parts and not identifier & EXTENDED:
            for name in (self.channel(channel), ""):
                if known := self.parts.get((name, identifier)):
                    return known
        return PdoPart(identifier)

    def list_of(self, channel: str, identifier: int) -> PdoList:
        """Return what is told of a list on a channel."""
        return self.lists.get((channel, identifier)) or self.lists.get(("", identifier)) or PdoList(1)


def is_pdo(frames: CanBatch) -> Bool:
    """Tell which frames may carry variables: data frames that can be read, be they captured whole or not."""
    told: Bool = (frames.fault == Fault.NONE) | (frames.fault >= Fault.TRUNCATED)
    told &= ~(frames.error | frames.remote)
    return told


def words(frames: CanBatch) -> U64:
    """Return what tells identifiers apart, uint64: the identifier, with ``EXTENDED`` where it is one of 29 bits."""
    number: U64 = frames.identifier.astype(np.uint64)
    number |= frames.extended.astype(np.uint64) << np.uint64(31)
    return number
