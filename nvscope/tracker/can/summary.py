"""What follows from the CAN frames seen: lists by channel and COB-ID, their intervals, and how busy each bus was."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct

from dissectors.can.pdo import EXTENDED
from nvscope.definition.buses import Buses
from nvscope.engine.keys import LENGTH_SHIFT, NOBODY_KEY
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.bus import CanBusSummary, summarize_buses
from nvscope.tracker.diagnosis import Diagnosis
from nvscope.tracker.intervals import IntervalFigures, StreamIntervals

if TYPE_CHECKING:
    from nvscope.tracker.state import TrackerState


class CanStreamSummary(Struct, frozen=True):
    """The frames of one COB-ID of a channel: as ``StreamSummary`` has it, of a sender that nobody knows.

    ``subindex`` is its place in its list, ``length`` the bytes of the last frame; ``remote`` counts frames that ask for
    it.
    """

    stream: int
    subindex: int
    cob_id: int
    extended: bool
    telegrams: int
    remote: int
    first_ns: int
    last_ns: int
    length: int
    intervals: IntervalFigures
    node: None = None


class CanListSummary(Struct, frozen=True):
    """One list on a channel; without a definition, it is one COB-ID alone.

    ``number`` is that of the state. ``diagnosis`` counts frames, and nothing else.
    """

    number: int
    key: ListKey
    diagnosis: Diagnosis
    streams: Sequence[CanStreamSummary]

    @property
    def extended(self) -> bool:
        """Whether its identifier is one of 29 bits."""
        return bool(self.key.identifier & EXTENDED)

    @staticmethod
    def of(number: int, key: ListKey, streams: list[CanStreamSummary]) -> CanListSummary:
        """Return the list with the given streams, of which there is at least one."""
        frames = sum(stream.telegrams for stream in streams)
        last_ns = max((stream.last_ns for stream in streams if stream.telegrams), default=None)
        diagnosis = Diagnosis(frames, last_ns, frames, last_ns, frames)
        return CanListSummary(number, key, diagnosis, tuple(sorted(streams, key=lambda stream: stream.subindex)))


class CanSummary(Struct, frozen=True):
    """Lists by channel and COB-ID, standard before extended; buses by name of the channel."""

    lists: Sequence[CanListSummary] = ()
    buses: Sequence[CanBusSummary] = ()


def summarize_can(
    state: TrackerState,
    intervals: StreamIntervals,
    *,
    intervals_ns: Mapping[ListKey, int] = MappingProxyType({}),
    buses: Buses | None = None,
    cob_ids: Collection[int] = (),
) -> CanSummary:
    """Compute what follows from the CAN frames of a state.

    ``intervals`` are those measured, ``intervals_ns`` the nominal ones of lists, ``buses`` the bit rates that are
    given, ``cob_ids`` those that defined lists take: they are not CANopen's.
    """
    if not len(state.buses.load.keys):
        return CanSummary()
    keys, memory = state.keys, state.memory.columns
    remotes = state.buses.remotes
    asked = dict(
        zip(
            zip(remotes.keys.high.tolist(), remotes.keys.low.tolist(), strict=True),
            remotes.rows.column("count").tolist(), strict=True,
        )
    )  # fmt: skip
    streams: dict[int, list[CanStreamSummary]] = defaultdict(list)
    known = np.flatnonzero(keys.streams.low == np.uint64(NOBODY_KEY))
    of_list, _, part = keys.described(known)
    _, channels, identifiers = keys.lists.words
    columns = (
        known, of_list, part, channels[of_list], identifiers[of_list], memory.signature[known], memory.telegrams[known],
        memory.first_ns[known], memory.last_ns[known],
    )  # fmt: skip
    keys_of_lists = keys.list_keys()
    nominal = [told_of(intervals_ns, key) for key in keys_of_lists] if intervals_ns else [None] * len(keys_of_lists)
    for stream, number, subindex, channel, index, signature, telegrams, first_ns, last_ns in zip(
        *(column.tolist() for column in columns), strict=True
    ):
        word = index if index & EXTENDED else index + subindex
        streams[number].append(
            CanStreamSummary(
                stream=stream,
                subindex=subindex,
                cob_id=word & ~EXTENDED,
                extended=bool(word & EXTENDED),
                telegrams=telegrams,
                remote=asked.get((channel, word), 0),
                first_ns=first_ns,
                last_ns=last_ns,
                length=signature >> int(LENGTH_SHIFT) & 0xFFFF,
                intervals=intervals.of(stream, nominal[number]),
            )
        )
    lists = [CanListSummary.of(number, keys_of_lists[number], own) for number, own in streams.items()]
    lists.sort(key=lambda entry: entry.key)
    summarized = summarize_buses(state.buses, keys.channel, buses, cob_ids, state.capture.holes)
    return CanSummary(tuple(lists), tuple(summarized))
