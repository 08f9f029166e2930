"""What was put into a scenario, and who sends in it: the words in which the truth about causes is told."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.list_key import ListKey
from nvscope.simulate.faults import Struck
from nvscope.simulate.observation import Observation
from nvscope.simulate.plan import ListPlan
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.telegram_faults import Selection

_CLUSTER_NS = 2_000_000_000
LONG_RUN = 5


MOST_APART = 8
"""So many things of one kind that one node explains are told one by one; of more, all of them are one."""


class PutIn(Struct, frozen=True):
    """One thing that goes wrong, in the words of a cause: its kind, where, and from when to when.

    Times are those of the scenario, from 0. ``until_ns`` is None where it is still so at the end. ``nodes`` are
    addresses; what it does not concern is empty or None.
    """

    kind: str
    since_ns: int
    until_ns: int | None
    lists: tuple[ListKey, ...] = ()
    nodes: tuple[str, ...] = ()
    channel: str | None = None


class Sent(Struct, frozen=True):
    """A list that a node sends over UDP from the time ``from_ns`` to ``until_ns``; ``number`` is that of its writer.

    ``further`` tells that another node sends the list, too, and did so before.
    """

    number: int
    address: str
    node: str
    plan: ListPlan
    from_ns: int
    until_ns: int
    further: bool

    @property
    def key(self) -> ListKey:
        return self.plan.list_key

    @property
    def cyclic(self) -> bool:
        return self.plan.mode == "cyclic"


class Gap(Struct, frozen=True):
    """Telegrams of a stream that are lost in a row, the first of which was sent at ``sent_ns``."""

    sent_ns: int
    stream: int
    lost: int


class Plant:
    """The nodes of a scenario and what they send, by address: an observer knows no others."""

    def __init__(self, scenario: Scenario, seen: Observation | None) -> None:
        self.scenario = scenario
        self.seen = seen
        self.end_ns = scenario.duration_ns
        self.addresses = {node.name: str(ipaddress.ip_address(node.address)) for node in scenario.node}

    @cached_property
    def sent(self) -> tuple[Sent, ...]:
        """The lists that nodes send, first those of the first senders."""
        found, first = [], self._first_senders()
        for number, writer in enumerate(self.seen.table.writers if self.seen else ()):
            plan, node = writer.plan, self.scenario.node[writer.node].name
            until_ns = self.end_ns if plan.until_ns is None else min(plan.until_ns, self.end_ns)
            further = self.addresses[node] != first[plan.list_key]
            found.append(Sent(number, self.addresses[node], node, plan, plan.from_ns, until_ns, further))
        return tuple(found)

    def _first_senders(self) -> dict[ListKey, str]:
        """Return who is the first one to send each list."""
        found: dict[ListKey, tuple[int, str]] = {}
        for writer in self.seen.table.writers if self.seen else ():
            address = self.addresses[self.scenario.node[writer.node].name]
            begin_ns = writer.plan.from_ns + writer.plan.phase_ns
            known = found.setdefault(writer.plan.list_key, (begin_ns, address))
            if begin_ns < known[0]:
                found[writer.plan.list_key] = begin_ns, address
        return {key: address for key, (_, address) in found.items()}

    @cached_property
    def sent_by(self) -> dict[str, list[Sent]]:
        """What each address sends as the first one."""
        found: dict[str, list[Sent]] = {}
        for one in self.sent:
            if not one.further and not self.scenario.node[self.scenario.node_numbers[one.node]].short_header:
                found.setdefault(one.address, []).append(one)
        return found

    def faults(self, *kinds: type[Selection]) -> Iterator[tuple[Selection, Struck]]:
        """Yield the faults of some kinds that struck telegrams of lists on UDP, with these."""
        for place, fault in self.scenario.selections():
            struck = self.seen.table.struck.get(place) if self.seen else None
            if isinstance(fault, kinds) and struck is not None and len(struck.stream):
                yield fault, struck

    def writer_of(self, stream: int) -> Sent:
        """Return who sends a stream, and which list."""
        assert self.seen is not None
        return self.sent[self.seen.streams[stream].writer]

    def seen_between(self, stream: int, sent_ns: I64) -> Bool:
        """Return which times lie between two telegrams of a stream that are seen, so that they can be known."""
        assert self.seen is not None
        ts_ns = self.seen.table.ts_ns[self.seen.rows_of_stream(stream)]
        if not len(ts_ns):
            return np.zeros(len(sent_ns), np.bool_)
        first_ns, last_ns = (self.true_ns(time) for time in (ts_ns.min(), ts_ns.max()))
        known: Bool = (sent_ns > first_ns) & (sent_ns < last_ns)
        return known

    def true_ns(self, ts_ns: int) -> int:
        """Return the time of the scenario at which the capture's clock, which is set forward only, shows another."""
        time_ns = int(ts_ns) - self.scenario.start_ns
        for step in sorted(self.scenario.clock_step, key=lambda step: -step.at_ns):
            if time_ns - step.by_ns >= step.at_ns:
                time_ns -= step.by_ns
        return time_ns

    def ended(self, first_ns: int, last_ns: int, count: int, interval_ns: int) -> int | None:
        """Return when many events ended, None where the last one is as near to the end as they are to each other."""
        usual_ns = (last_ns - first_ns) // (count - 1) if count > 1 else 0
        near_ns = max(2 * usual_ns, interval_ns * 5 // 2)
        return None if self.end_ns - last_ns <= near_ns else last_ns


def runs(values: I64) -> list[tuple[int, int]]:
    """Return where numbers that rise by one begin, and how many they are."""
    if not len(values):
        return []
    cuts = np.flatnonzero(np.diff(values) != 1) + 1
    starts = np.append(0, cuts)
    return list(zip(starts.tolist(), np.diff(np.append(starts, len(values))).tolist(), strict=True))


def clusters(gaps: Sequence[Gap]) -> list[list[Gap]]:
    """Return gaps by what is one cause: those near one in which many are lost in a row, and all others together."""
    near: list[list[Gap]] = []
    for gap in sorted(gaps, key=lambda one: one.sent_ns):
        if near and gap.sent_ns - near[-1][-1].sent_ns <= _CLUSTER_NS:
            near[-1].append(gap)
        else:
            near.append([gap])
    long = [group for group in near if max(gap.lost for gap in group) >= LONG_RUN]
    rest = [gap for group in near if max(gap.lost for gap in group) < LONG_RUN for gap in group]
    return [*long, rest] if rest else long


def of_many(found: Iterable[tuple[object, PutIn]]) -> Iterator[PutIn]:
    """Yield what was put in, of one kind, by what it has in common; as one, where that is very many."""
    together: dict[object, list[PutIn]] = {}
    for common, one in found:
        together.setdefault(common, []).append(one)
    for every in together.values():
        if len(every) <= MOST_APART:
            yield from every
            continue
        ends = [one.until_ns for one in every]
        until_ns = None if None in ends else max(end for end in ends if end is not None)
        lists = tuple(dict.fromkeys(key for one in every for key in one.lists))
        yield PutIn(every[0].kind, min(one.since_ns for one in every), until_ns, lists, every[0].nodes)
