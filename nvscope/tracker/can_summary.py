"""What follows from the CAN frames seen: lists by channel and COB-ID, their intervals, and how busy each bus was."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from dissectors.can import EXTENDED_MASK
from nvscope.definition.buses import Buses
from nvscope.tracker.can_bus import CanBusSummary, channel_name, summarize_buses
from nvscope.tracker.can_identifiers import EXTENDED_KEY
from nvscope.tracker.can_state import CanState
from nvscope.tracker.intervals import Intervals, intervals_of


def can_key(channel: str, cob_id: int) -> str:
    """Return the key of a list on CAN, as people and reports name it."""
    return f"can/{channel}/{cob_id}"


@dataclass(frozen=True, slots=True)
class CanStreamSummary:
    """The frames of one COB-ID of a channel.

    ``subindex`` is its place in its list, ``length`` that of the last one; ``by_length`` as in ``CanColumns``.
    """

    stream: int
    cob_id: int
    extended: bool
    subindex: int
    frames: int
    remote: int
    first_ns: int
    last_ns: int
    first_frame: int
    last_frame: int
    length: int
    by_length: tuple[int, ...]
    intervals: Intervals


@dataclass(frozen=True, slots=True)
class CanListSummary:
    """One list on a channel; without a definition, it is one COB-ID alone.

    ``number`` continues those of the lists on UDP.
    """

    number: int
    channel: str
    cob_id: int
    streams: Sequence[CanStreamSummary]

    @property
    def key(self) -> str:
        return can_key(self.channel, self.cob_id)


@dataclass(frozen=True, slots=True)
class CanSummary:
    """Lists by channel and COB-ID, standard before extended; buses by name of the channel."""

    lists: Sequence[CanListSummary] = ()
    buses: Sequence[CanBusSummary] = ()
    channels: Sequence[str] = ()

    def channel(self, number: int) -> str:
        """Return the name of a channel."""
        return channel_name(self.channels, number)


def summarize_can(
    state: CanState,
    channels: Sequence[str] = (),
    first_number: int = 0,
    *,
    parts: Mapping[int, tuple[int, int]] = MappingProxyType({}),
    intervals_ns: Mapping[int, int] = MappingProxyType({}),
    buses: Buses | None = None,
) -> CanSummary:
    """Compute the summary of a state; ``channels`` are the names by number, ``can0`` and so on where there are none.

    ``first_number`` is the number of the first list. ``parts`` tells of standard COB-IDs to which list (by its COB-ID)
    they belong, and as which part; another COB-ID is a list alone. ``intervals_ns`` are the nominal intervals of lists,
    ``buses`` the bit rates that are given.
    """
    histograms = state.timing.histograms()
    streams: dict[tuple[str, int], list[CanStreamSummary]] = defaultdict(list)
    keys = zip(state.streams.high.tolist(), state.streams.low.tolist(), strict=True)
    for stream, (channel, word) in enumerate(keys):
        columns = state.columns
        known = {name: int(getattr(columns, name)[stream]) for name in columns.COLUMNS if name != "by_length"}
        if not known["frames"]:
            continue
        extended, cob_id = bool(word & EXTENDED_KEY), word & EXTENDED_MASK
        base, subindex = (word, 0) if extended else parts.get(cob_id, (cob_id, 0))
        intervals = intervals_of(state.timing, stream, histograms.of(stream), intervals_ns.get(base))
        streams[channel_name(channels, channel), base].append(
            CanStreamSummary(
                stream=stream, cob_id=cob_id, extended=extended, subindex=subindex, intervals=intervals,
                by_length=tuple(columns.by_length[stream].tolist()), **known
            )
        )  # fmt: skip
    lists = [
        CanListSummary(
            first_number + number, channel, base & EXTENDED_MASK, sorted(own, key=lambda stream: stream.subindex)
        )
        for number, ((channel, base), own) in enumerate(sorted(streams.items()))
    ]
    return CanSummary(lists, summarize_buses(state, channels, buses, parts), channels)
