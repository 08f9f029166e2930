"""Contacts: who sends which list to whom, who answers and how fast, who does not, and which devices nodes are.

All of it is a copy of what was known at a moment: a screen looks at it while the state goes on.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U64
from nvscope.engine.keys import NOBODY, FrameKind
from nvscope.engine.limit import ELSEWHERE
from nvscope.tracker.event_kinds import EventKind
from nvscope.tracker.evidence.presence import HARDWARE_BITS, IP
from nvscope.tracker.evidence.witness import Witness
from nvscope.tracker.state import TrackerState

_DATA = (FrameKind.DATA, FrameKind.MALFORMED_DATA)
_ASKED = (FrameKind.ACKNOWLEDGEMENT, FrameKind.BOOT_UP_REQUEST)
_PERCENTS = (50, 99)


class Answered(NamedTuple):
    """The telegrams of a list that a reader acknowledged first: how many, when first and last, and how fast in ns."""

    times: int
    first_ns: int
    last_ns: int
    p50_ns: int
    p99_ns: int


class Happened(NamedTuple):
    """How often something happened, and when first and last."""

    times: int
    first_ns: int
    last_ns: int


class Contacts(Struct, frozen=True, dict=True):
    """Who sends to whom. Lists and nodes are numbers, as in a summary; columns are int64 of shape (n,).

    ``flows`` are the columns kind (``FrameKind``), list, source, destination, count and last time; ``answers`` list,
    reader, and those of ``Answered``; ``unanswered`` event kind, list, peer, and those of ``Happened``; ``devices``
    node and hardware address, in the order of the first frames. ``others_ns`` is when each node sent something last
    that is no telegram, the least number for never. ``left_out``: events for which there was no room.
    """

    flows: tuple[I64, ...]
    answers: tuple[I64, ...]
    unanswered: tuple[I64, ...]
    devices: tuple[I64, I64]
    others_ns: I64
    left_out: int = 0

    @property
    def rows(self) -> int:
        """How many rows all columns have."""
        return sum(len(columns[0]) for columns in (self.flows, self.answers, self.unanswered, self.devices))

    @cached_property
    def destinations(self) -> Mapping[int, tuple[frozenset[int], bool]]:
        """The nodes that the data of each list goes to, and whether it goes to all of them, too, by its number."""
        return _destinations(self.flows)

    @cached_property
    def spoken(self) -> Mapping[tuple[int, int], Mapping[FrameKind, Happened]]:
        """What readers sent for lists by list and reader: acknowledgements, boot-up requests; no first time is known.

        Of acknowledgements these are all of them, whether another reader was faster or not.
        """
        found: dict[tuple[int, int], dict[FrameKind, Happened]] = {}
        for kind, number, source, _, count, last_ns in zip(*(column.tolist() for column in self.flows), strict=True):
            if kind in _ASKED:
                own = found.setdefault((number, source), {})
                before = own.get(FrameKind(kind), Happened(0, 0, last_ns))
                own[FrameKind(kind)] = Happened(before.times + count, 0, max(before.last_ns, last_ns))
        return found

    @cached_property
    def answered(self) -> Mapping[tuple[int, int], Answered]:
        """The acknowledgements by list and reader."""
        rows = zip(*(column.tolist() for column in self.answers), strict=True)
        return {(number, reader): Answered(*own) for number, reader, *own in rows}

    @cached_property
    def refused(self) -> Mapping[tuple[int, int], Mapping[EventKind, Happened]]:
        """What went wrong by list and peer, below 0 for nobody in particular."""
        found: dict[tuple[int, int], dict[EventKind, Happened]] = {}
        for kind, number, peer, *own in zip(*(column.tolist() for column in self.unanswered), strict=True):
            found.setdefault((number, peer), {})[EventKind(kind)] = Happened(*own)
        return found

    @cached_property
    def last_of_node(self) -> Mapping[int, int]:
        """When each node was heard last, with whatever it sent."""
        _, _, source, _, count, last_ns = self.flows
        heard = self.others_ns.copy()
        own = (count > 0) & (source >= 0) & (source < len(heard))
        np.maximum.at(heard, source[own], last_ns[own])
        known = np.flatnonzero(heard > np.iinfo(np.int64).min)
        return dict(zip(known.tolist(), heard[known].tolist(), strict=True))

    def hardware_of(self, node: int) -> list[int]:
        """Return the hardware addresses that a node's packets came from, in the order of their first frames."""
        own: list[int] = self.devices[1][self.devices[0] == node].tolist()
        return own


def destinations_of(state: TrackerState) -> Mapping[int, tuple[frozenset[int], bool]]:
    """Return the nodes that the data of each list goes to, and whether it goes to all of them, too, by its number."""
    return _destinations(_flows(state))


def _destinations(flows: tuple[I64, ...]) -> Mapping[int, tuple[frozenset[int], bool]]:
    found: dict[int, tuple[set[int], bool]] = {}
    for kind, number, _, to, *_ in zip(*(column.tolist() for column in flows), strict=True):
        if kind in _DATA and to != ELSEWHERE:
            nodes, everybody = found.get(number, (set(), False))
            found[number] = (nodes | {to}, everybody) if to != NOBODY else (nodes, True)
    return {number: (frozenset(nodes), everybody) for number, (nodes, everybody) in found.items()}


def _flows(state: TrackerState) -> tuple[I64, ...]:
    table = state.lists.flows
    kind = table.column("kind")
    chosen = np.flatnonzero(np.isin(kind, [*_DATA, *_ASKED]) & (table.column("source") >= 0))
    names = ("kind", "list", "source", "destination", "count", "last_ns")
    return tuple(table.column(name)[chosen].astype(np.int64) for name in names)


def contacts_of(state: TrackerState, witness: Witness) -> Contacts:
    """Return who sends to whom, by a state and a witness that has settled; nothing changes by it."""
    unanswered = witness.unanswered
    refused = tuple(word.view(np.int64).copy() for word in unanswered.keys.words)
    refused += tuple(unanswered.columns.column(name).copy() for name in ("count", "first_ns", "last_ns"))
    left_out = unanswered.left_out + witness.evidence.answers.left_out
    return Contacts(
        _flows(state), _answers(witness), refused, _devices(state, witness), _others_ns(state, witness), left_out
    )


def _answers(witness: Witness) -> tuple[I64, ...]:
    answers = witness.evidence.answers
    told = answers.latencies.percentiles(_PERCENTS)
    row = told.stream
    lists, readers = (word.astype(np.int64)[row] for word in answers.pairs.words)
    first_ns, last_ns = (answers.columns.column(name)[row] for name in ("first_ns", "last_ns"))
    return lists, readers, told.count, first_ns, last_ns, *(told.at_ns[percent] for percent in _PERCENTS)


def _devices(state: TrackerState, witness: Witness) -> tuple[I64, I64]:
    presence = witness.presence
    high, low, device, _ = presence.pairs.words
    node = state.keys.nodes.find(high, low)
    order = np.argsort(presence.pair_columns.column("first_frame"), kind="stable")
    order = order[node[order] >= 0]
    pairs = dict.fromkeys(zip(node[order].tolist(), _bare(device[order]).tolist(), strict=True))
    columns = np.array(list(pairs), np.int64).reshape(-1, 2)
    return columns[:, 0], columns[:, 1]


def _bare(device: U64) -> I64:
    bare: I64 = (device & HARDWARE_BITS).astype(np.int64)
    return bare


def _others_ns(state: TrackerState, witness: Witness) -> I64:
    nodes, presence = state.keys.nodes, witness.presence
    number = presence.addresses.find(np.full(len(nodes), IP, np.uint64), nodes.high, nodes.low)
    last_ns = np.full(len(nodes), np.iinfo(np.int64).min)
    known = number >= 0
    last_ns[known] = presence.columns.last_other_ns[number[known]]
    return last_ns
