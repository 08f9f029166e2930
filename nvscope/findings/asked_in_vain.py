"""What hosts asked for that nobody has: lists, ports, and partners."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nvscope import units
from nvscope.engine.keys import FrameKind

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.parameter.summary import PairSummary
    from nvscope.tracker.parameter.transactions import Asked as AskedFor


class Asked(NamedTuple):
    """A list, a port, or a partner, that a host asked for first at a time."""

    first_ns: int
    frame: int
    what: str


class _Times(NamedTuple):
    """How often a parameter was asked for in vain, when first and last, and the first frame."""

    number: int
    first_ns: int
    last_ns: int
    frame: int


LEAST_ROUNDS = 3
"""Who asks the same partners the same so often, in turn, polls them. Who looks for some asks each of them once."""


def dense(asked: Sequence[Asked], least: int, within_ns: int) -> Sequence[Asked]:
    """Return what was asked for among at least so many within a time, as it was."""
    if len(asked) < least:
        return ()
    ordered = sorted(asked)
    time_ns = np.array([one.first_ns for one in ordered], np.int64)
    end = np.searchsorted(time_ns, time_ns + within_ns, "right")
    begins = np.flatnonzero(end - np.arange(len(end)) >= least)
    chosen = np.zeros(len(end) + 1, np.int64)
    np.add.at(chosen, begins, 1)
    np.add.at(chosen, end[begins], -1)
    return [ordered[place] for place in np.flatnonzero(np.cumsum(chosen)[:-1] > 0).tolist()]


def _requests(facts: Facts) -> Sequence[tuple[int, int, int, int]]:
    """Return node, list, first time and frame of each flow of boot-up requests."""
    flows = facts.state.lists.flows
    rows = np.flatnonzero((flows.column("kind") == FrameKind.BOOT_UP_REQUEST) & (flows.column("count") > 0))
    names = ("source", "list", "first_ns", "first_frame")
    return [*zip(*(flows.column(name)[rows].tolist() for name in names), strict=True)]


def _is_nobodys(facts: Facts) -> dict[int, str]:
    """Return the lists that nobody sends and no definition knows, by number, with their keys."""
    known = {
        (port, number) for node in facts.nodes.values() for port, number in (*node.reads, *node.writes)
    }  # fmt: skip
    return {
        entry.number: units.list_key(str(entry.key))
        for entry in facts.summary.lists
        if not entry.senders and entry.key not in facts.defined and not facts.misses_data(entry.number)
        and known.isdisjoint({(None, entry.key.identifier), (entry.key.port, entry.key.identifier)})
    }  # fmt: skip


def lists_in_vain(facts: Facts) -> Mapping[int, Sequence[Asked]]:
    """Return the lists that each node asked for, and that nobody has."""
    requests = _requests(facts)
    nobodys = _is_nobodys(facts) if requests else {}
    found: dict[int, dict[int, Asked]] = defaultdict(dict)
    for node, number, first_ns, frame in requests:
        if number in nobodys:
            one = Asked(first_ns, frame, nobodys[number])
            # One a SubIndex, and one a receiver: the first of them counts.
            found[node][number] = min(found[node].get(number, one), one)
    return {node: [*asked.values()] for node, asked in found.items()}


def ports_in_vain(facts: Facts) -> Mapping[int, Sequence[Asked]]:
    """Return the ports on which each node asked, and on which nobody sends a list or replies."""
    found: dict[int, dict[str, Asked]] = defaultdict(dict)
    _add_ports_of_requests(facts, found)
    _add_ports_of_parameters(facts, found)
    return {node: [*asked.values()] for node, asked in found.items()}


def _add_ports_of_requests(facts: Facts, ports: dict[int, dict[str, Asked]]) -> None:
    """Add the ports on which nodes asked for lists, and on which no list is sent."""
    requests = _requests(facts)
    if not requests:
        return
    keys = {entry.number: entry.key for entry in facts.summary.lists}
    used = {int(entry.key.port) for entry in facts.summary.lists if entry.senders or facts.misses_data(entry.number)}
    used |= {int(key.port) for key in facts.defined if isinstance(key.port, int)}
    for node, number, first_ns, frame in requests:
        port = int(keys[number].port)
        if port not in used:
            _add(ports[node], first_ns, frame, str(port))


def _add_ports_of_parameters(facts: Facts, ports: dict[int, dict[str, Asked]]) -> None:
    """Add the ports on which nodes asked for parameters, and nobody replied to anybody."""
    used = {pair.port for pair in facts.summary.parameters if _replied(pair)}
    for node, asked, times in _unanswered(facts):
        if asked.port not in used:
            _add(ports[node], times.first_ns, times.frame, str(asked.port))


def partners_in_vain(facts: Facts) -> Mapping[int, Sequence[Asked]]:
    """Return the partners that each node asked for parameters, and that nobody knows.

    These reply to nobody, send no list, and have no name in the project; what goes to everybody is for none of them.
    Nor are those looked for that are polled, as a mirror of one direction shows it.
    """
    found: dict[int, dict[str, Asked]] = defaultdict(dict)
    rounds: dict[int, dict[str, tuple[int, int]]] = defaultdict(dict)
    known = {pair.partner for pair in facts.summary.parameters if _replied(pair)} | facts.nodes.keys()
    known |= {facts.address(node) for entry in facts.summary.lists for node in entry.senders}
    for node, asked, times in _unanswered(facts):
        if asked.partner not in known and asked.partner in facts.node_numbers:
            _add(found[node], times.first_ns, times.frame, asked.partner)
            so_far = rounds[node].get(asked.partner, (0, 0))
            rounds[node][asked.partner] = max(so_far, (times.number, times.last_ns))
    return {node: [*asked.values()] for node, asked in found.items() if not _polls(asked.values(), rounds[node])}


def _polls(asked: Collection[Asked], rounds: Mapping[str, tuple[int, int]]) -> bool:
    """Tell whether most partners were asked for one and the same again and again, still behind the last new one.

    ``rounds`` is how often that was at most, and when last, by partner.
    """
    last_ns = max(one.first_ns for one in asked)
    polled = sum(count >= LEAST_ROUNDS and time_ns > last_ns for count, time_ns in rounds.values())
    return 2 * polled > len(asked)


def _replied(pair: PairSummary) -> bool:
    return bool(pair.replies or pair.busy or pair.unexpected)


def _unanswered(facts: Facts) -> Iterator[tuple[int, AskedFor, _Times]]:
    """Yield who asked for parameters that nobody answered, for which, and when."""
    known = facts.state.parameters.known
    if known is None:
        return
    from nvscope.tracker.parameter.events import ParameterEvent, event_parts

    log = known.events
    names = ("count", "first_ns", "last_ns", "frames")
    for word, parameter, count, first_ns, last_ns, frames in zip(
        log.keys.high.tolist(), log.keys.low.tolist(), *(log.rows.column(name).tolist() for name in names), strict=True
    ):
        if event_parts(word)[0] == ParameterEvent.TIMEOUT:
            asked = known.described(parameter)
            node = facts.node_numbers.get(asked.requester)
            if node is not None:
                yield node, asked, _Times(count, first_ns, last_ns, frames[0])


def _add(found: dict[str, Asked], first_ns: int, frame: int, what: str) -> None:
    one = Asked(first_ns, frame, what)
    found[what] = min(found.get(what, one), one)
