"""CanListFacts: the frames of each list on CAN, as who knows the definitions tells them apart."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.can.frame import EXTENDED
from nvscope.list_key import ListKey
from nvscope.simulate.can.frame_table import CanFrames
from nvscope.simulate.can.tables import CanList
from nvscope.simulate.ordering import order_by
from nvscope.simulate.scenario import Scenario


class Identity(NamedTuple):
    """An identifier of a bus; extended ones come behind the others."""

    channel: str
    extended: bool
    identifier: int


class CanStreamFacts(Struct, frozen=True):
    """The data frames of one identifier, as rows of the frames; ``remote`` counts the requests for it.

    ``plan`` is the list whose definition tells of the identifier, None where none does.
    """

    identity: Identity
    plan: CanList | None
    subindex: int
    rows: I64
    intervals: I64
    remote: int


class CanListFacts(Struct, frozen=True):
    """A list on a bus: one that a definition tells of, or an identifier by itself; its streams stand by SubIndex.

    ``rows`` are those of all its streams. ``entries`` are the places of those lists of the scenario that are this one.
    """

    key: ListKey
    streams: tuple[CanStreamFacts, ...]
    rows: I64
    entries: tuple[int, ...]

    @property
    def plan(self) -> CanList | None:
        """The list of the scenario whose definition tells of this one."""
        return self.streams[0].plan


class _Place(Struct, frozen=True):
    """Where an identifier belongs: the list by its first identifier, and what its definition says, if there is one."""

    base: int
    subindex: int = 0
    plan: CanList | None = None


def can_list_facts(scenario: Scenario, frames: CanFrames) -> list[CanListFacts]:
    """Return the lists of which a data frame is seen, in the order of a report."""
    places = _places(scenario)
    lists: dict[ListKey, list[CanStreamFacts]] = {}
    remote = dict(_by_identity(scenario, frames, np.flatnonzero(frames.remote)))
    for identity, rows in _by_identity(scenario, frames, np.flatnonzero(~frames.error & ~frames.remote)):
        place = _Place(identity.identifier)
        if not identity.extended:
            place = places.get(identity.identifier, place)
        first = place.base | (EXTENDED.mask if identity.extended else 0)
        intervals: I64 = np.diff(frames.ts_ns[rows])
        stream = CanStreamFacts(identity, place.plan, place.subindex, rows, intervals, len(remote.get(identity, ())))
        lists.setdefault(ListKey.can(identity.channel, first), []).append(stream)
    return [_list(scenario, key, lists[key]) for key in sorted(lists)]


def _list(scenario: Scenario, key: ListKey, members: list[CanStreamFacts]) -> CanListFacts:
    streams = tuple(sorted(members, key=lambda stream: stream.subindex))
    plan = streams[0].plan
    entries = tuple(
        number
        for number, entry in enumerate(scenario.can_list)
        if plan is not None and entry.channel == key.port and entry.cob_id == plan.cob_id
    )
    return CanListFacts(key, streams, np.sort(np.concatenate([stream.rows for stream in streams])), entries)


def _places(scenario: Scenario) -> dict[int, _Place]:
    """Return where the identifiers of 11 bits belong of which a definition tells."""
    places: dict[int, _Place] = {}
    for plan in scenario.can_list:
        for subindex in range(len(plan.data_bytes) if plan.has_definition else 0):
            places.setdefault(plan.cob_id + subindex, _Place(plan.cob_id, subindex, plan))
    return places


def _by_identity(scenario: Scenario, frames: CanFrames, rows: I64) -> Iterator[tuple[Identity, I64]]:
    """Yield the rows of each identifier, as captured."""
    key = frames.channel[rows].astype(np.int64) << 32 | frames.word[rows] & np.uint32(EXTENDED.mask | 0x1FFF_FFFF)
    words, group = np.unique(key, return_inverse=True)
    order = order_by(group)
    cuts = np.cumsum(np.bincount(group, minlength=len(words)))[:-1]
    for word, own in zip(words.tolist(), np.split(order, cuts), strict=False):
        identity = Identity(scenario.channels[word >> 32], bool(word & EXTENDED.mask), word & 0x1FFF_FFFF)
        yield identity, rows[own]
