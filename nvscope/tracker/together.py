"""Together: what the streams of a list, and those of one node on it, come to when they are taken together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import Struct, field

from nvscope.engine.keys import NOBODY_KEY
from nvscope.engine.limit import Missing
from nvscope.engine.runs import distinct
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.figures import BY_SCOPE
from nvscope.tracker.intervals import IntervalFigures, StreamIntervals
from nvscope.tracker.latency import UNKNOWN_LATENCY, LatencyFigures

if TYPE_CHECKING:
    from nvscope.tracker.state import TrackerState
    from nvscope.tracker.stream_summary import StreamSummary

Member = tuple[int, int]
"""Numbers of a list and of a node that sends it."""


def _nothing() -> Mapping[Any, Any]:
    return MappingProxyType({})


class Together(Struct, frozen=True):
    """Intervals and latencies by number of list, and by list and node; latencies also by stream.

    What has none is not there. On CAN, nobody knows who sends.
    """

    intervals: Mapping[int, IntervalFigures] = field(default_factory=_nothing)
    intervals_of_node: Mapping[Member, IntervalFigures] = field(default_factory=_nothing)
    latency: Mapping[int, LatencyFigures] = field(default_factory=_nothing)
    latency_of_node: Mapping[Member, LatencyFigures] = field(default_factory=_nothing)
    latency_of_stream: Mapping[int, LatencyFigures] = field(default_factory=_nothing)


def taken_together(state: TrackerState, intervals: StreamIntervals, intervals_ns: Mapping[ListKey, int]) -> Together:
    """Take the streams of a state together; ``intervals_ns`` are the nominal intervals of lists."""
    keys, latencies = state.keys, state.lists.acknowledgement.latencies
    list_of = keys.places.high[keys.streams.high.astype(np.int64)].astype(np.int64)
    nominal: dict[int, int | None] = {}
    if intervals_ns:
        nominal = {number: told_of(intervals_ns, key) for number, key in enumerate(keys.list_keys())}
    of_list, latency_of_list = intervals.together(list_of, nominal), latencies.figures(list_of)
    sent = np.flatnonzero(keys.streams.low != np.uint64(NOBODY_KEY))
    word = list_of[sent] * len(keys.nodes) + keys.node_of(sent)
    found = distinct(word)
    lists, nodes = found // max(len(keys.nodes), 1), found % max(len(keys.nodes), 1)
    members: list[Member] = list(zip(lists.tolist(), nodes.tolist(), strict=True))
    # Where one node sends all streams of a list, both have the same.
    alone = np.bincount(lists, minlength=1)[lists] == 1
    alike = [member for member, same in zip(members, alone.tolist(), strict=True) if same]
    member_of = np.full(len(list_of), -1)
    member_of[sent] = np.where(alone, -1, np.arange(len(members)))[np.searchsorted(found, word)]
    nominal_of_member = {one: nominal.get(own_list) for one, (own_list, _) in enumerate(members)} if nominal else {}
    of_member, latency_of_member = intervals.together(member_of, nominal_of_member), latencies.figures(member_of)
    latency_of_stream = latencies.figures(np.arange(len(list_of)))
    latency_of_node = {member: latency_of_list[member[0]] for member in alike if member[0] in latency_of_list} | {
        members[one]: row for one, row in latency_of_member.items()
    }
    unheard = np.flatnonzero(keys.left_out.of_lists(keys.lists) & Missing.ACKNOWLEDGEMENTS).tolist()
    if unheard:
        # What seems to be the first acknowledgement may have been a later one.
        latency_of_list |= dict.fromkeys(unheard, UNKNOWN_LATENCY)
        concerned = np.flatnonzero(np.isin(list_of, unheard)).tolist()
        latency_of_stream |= dict.fromkeys(concerned, UNKNOWN_LATENCY)
        latency_of_node |= {member: UNKNOWN_LATENCY for member in members if member[0] in set(unheard)}
    return Together(
        MappingProxyType(of_list),
        MappingProxyType(
            {member: of_list[member[0]] for member in alike if member[0] in of_list}
            | {members[one]: row for one, row in of_member.items()}
        ),
        MappingProxyType(latency_of_list),
        MappingProxyType(latency_of_node),
        MappingProxyType(latency_of_stream),
    )


NOTHING_KNOWN_TOGETHER: Mapping[str, None] = MappingProxyType(dict.fromkeys((*BY_SCOPE, "lost_claimed")))
"""The counters of streams that are not all there."""


def counted_together(streams: Collection[StreamSummary]) -> dict[str, int | None]:
    """Return the counters of streams, by name; what is unknown of one of them is unknown of all.

    How many are lost is unknown where one of them is not believed.
    """
    if len(streams) == 1:
        (alone,) = streams
        counters: dict[str, int | None] = {**alone.figures}
    else:
        counters = {}
        for name in BY_SCOPE:
            own = [stream.figures[name] for stream in streams]
            known = [number for number in own if number is not None]
            total = max(known, default=0) if name == "longest_gap" else sum(known)
            counters[name] = total if len(known) == len(own) else None
    counters["lost_claimed"] = counters["lost"]
    if any(stream.erratic for stream in streams):
        counters["lost"] = None
    return counters
