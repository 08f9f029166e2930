"""CobIds: which identifiers a list takes on CAN, which of them another list takes too, and which CANopen uses.

A list takes one identifier for each frame, counted up from its own (Network Functionality in CoDeSys V2.3, section
2.3); no assumption on packing beyond the number of frames is needed. Linting and reports both judge by this.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec import Struct

from dissectors.can.canopen import Service, services_within
from nvscope import units
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import PDO_DATA_BYTES, pack
from nvscope.list_key import ANY_CHANNEL

_MOST_NEIGHBOURS = 100
"""So many lists that overlap one list are named; where there are more, the identifiers are all alike."""


class CobIds(Struct, frozen=True):
    """The COB-IDs from ``first`` to ``last`` of a list on CAN."""

    list: ListDefinition
    first: int
    last: int

    def shared(self, other: CobIds) -> range:
        """Return the COB-IDs that both lists take."""
        return range(max(self.first, other.first), min(self.last, other.last) + 1)

    @property
    def text(self) -> str:
        """The COB-IDs as people write them: ``0x181 to 0x183``."""
        return units.cob_id_range(self.first, self.last)


def taken_by(entry: ListDefinition) -> CobIds | None:
    """Return what a list takes; None where it is not on CAN, or nobody knows its identifier.

    An element that no frame holds takes one COB-ID for each 8 bytes begun. With elements of unknown size it is what
    the list takes at least. ConfigurationError where it cannot be packed.
    """
    if not entry.on_can or entry.list_id is None:
        return None
    frames = sum(max(1, -(-telegram.layout.size_bytes // PDO_DATA_BYTES)) for telegram in pack(entry))
    return CobIds(entry, entry.list_id, entry.list_id + max(frames, 1) - 1)


def taken_in(definition: Definition) -> list[CobIds]:
    """Return what each list on CAN takes, as they are defined. ConfigurationError for one that cannot be packed."""
    return [taken for entry in definition.lists if (taken := taken_by(entry)) is not None]


def overlaps(lists: Sequence[CobIds]) -> Iterator[tuple[CobIds, CobIds]]:
    """Yield pairs of lists that take a COB-ID both, in the order in which they are defined.

    A list over several connections is there more than once, and so is one of which the sender's and the reader's file
    are both known: these are no pairs.
    """
    order = sorted(range(len(lists)), key=lambda place: (lists[place].first, place))
    found: list[tuple[int, int]] = []
    for at, place in enumerate(order):
        own = lists[place]
        near = (other for other in order[at + 1 : at + 1 + _MOST_NEIGHBOURS])
        for other in near:
            if lists[other].first > own.last:
                break
            found.append((min(place, other), max(place, other)))
    for one, other in sorted(found):
        if _one_bus(lists[one].list, lists[other].list) and not _one_list(lists[one].list, lists[other].list):
            yield lists[one], lists[other]


def _one_bus(one: ListDefinition, other: ListDefinition) -> bool:
    """Tell whether lists may meet on a channel."""
    return ANY_CHANNEL in (one.channel, other.channel) or one.channel == other.channel


def _one_list(one: ListDefinition, other: ListDefinition) -> bool:
    if one.position == other.position:
        return True
    if one.list_id != other.list_id or one.name.upper() != other.name.upper():
        return False
    # Not before there are two files of one list: it takes as long to import as all else here.
    from nvscope.definition.difference import list_difference  # noqa: PLC0415

    return list_difference(one, other).may_be_same


def canopen_uses(taken: CobIds) -> str:
    """Return which services of CANopen use COB-IDs of a list: ``TPDO1 of nodes 1 to 3, SYNC``; "" without any."""
    return ", ".join(_use(service, taken) for service in services_within(taken.first, taken.last))


def canopen_ids(taken: CobIds) -> list[int]:
    """Return the COB-IDs of a list that CANopen has given away."""
    return [
        cob_id
        for service in services_within(taken.first, taken.last)
        for cob_id in range(max(service.first, taken.first), min(service.last, taken.last) + 1)
    ]


def _use(service: Service, taken: CobIds) -> str:
    if not service.by_node:
        return f"{service.name} ({units.cob_id_range(service.first, service.last)})"
    first, last = (
        cob_id - service.first + 1 for cob_id in (max(service.first, taken.first), min(service.last, taken.last))
    )
    return f"{service.name} of node {first}" if first == last else f"{service.name} of nodes {first} to {last}"
