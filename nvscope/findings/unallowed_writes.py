"""NV962: writes by hosts that may not write, and at times at which nobody may."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from nvscope import units
from nvscope.enumeration import first_few
from nvscope.findings.finding import Events, Finding, events_of
from nvscope.findings.kind import MOST_APART, FindingKind, Severity
from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.definition.project_security import Security
    from nvscope.findings.facts import Facts
    from nvscope.tracker.parameter.writes import Writes

WRITE_NOT_ALLOWED = FindingKind(
    "NV962",
    "write-not-allowed",
    Severity.ERROR,
    meaning=(
        "A parameter (SDO) or a variable (WebVisu) was written by a host that [security] of the project does not name "
        "in `writers`, or at a time outside its `hours`, local time. Neither protocol asks for a user: whoever reaches "
        "the controller can write."
    ),
    causes=(
        "a panel or a PC that was added, and is not in the project file yet",
        "work on the plant outside the usual hours",
        "somebody who should not be there",
    ),
    next_steps=(
        "See what was written: the tables of writes in `nvscope report -v`, or `nvscope packets -Y sdo.write`.",
        "Ask who worked at that address at that time; what may be so belongs into [security].",
        "Keep controllers in a network of their own, which only those who write can reach.",
    ),
    of_security=True,
)

_MINUTE_NS = 60_000_000_000
_HINT_OF_PAGES = "See the WebVisu writes in `nvscope report -v`: what was written, over which value."


class _Written:
    """What a host wrote at a partner that it should not have, or not then; names of it in their order.

    ``unseen`` are those of which nothing but the reply was captured, ``refused`` those that the partner has refused, as
    far as that is known.
    """

    def __init__(self) -> None:
        self.events: Events | None = None
        self.names: dict[str, None] = {}
        self.is_stranger = False
        self.unseen = self.refused = 0
        self.first_outside_ns: int | None = None

    def add(self, name: str, events: Events, *, is_stranger: bool) -> None:
        """Take some more, in any order; ``name`` is what was written, '' where nobody knows."""
        if name:
            self.names[name] = None
        self.is_stranger |= is_stranger
        if not is_stranger:
            known = self.first_outside_ns
            self.first_outside_ns = events.first_ns if known is None else min(known, events.first_ns)
        self.events = events if self.events is None else self.events.among(events)


class _Allowed:
    """What the project lets whom do when, asked once of each host and minute: there may be very many writes."""

    def __init__(self, security: Security) -> None:
        self.security = security
        self._hosts: dict[str, bool] = {}
        self._minutes: dict[int, bool] = {}

    def lets_write(self, host: str) -> bool:
        if host not in self._hosts:
            self._hosts[host] = self.security.lets_write(host)
        return self._hosts[host]

    def lets_write_in(self, minute: int) -> bool:
        if minute not in self._minutes:
            self._minutes[minute] = self.security.lets_write_at(minute * _MINUTE_NS)
        return self._minutes[minute]


def judge_writes(facts: Facts) -> Iterator[Finding]:
    """Yield a finding for each host and controller between which there were such writes, by protocol."""
    security = facts.security
    if security is None or not security.judges_writes:
        return
    allowed = _Allowed(security)
    for protocol, (found, at_least) in (
        ("sdo", _parameters(facts, allowed)), ("visu", _variables(facts, allowed)),
    ):  # fmt: skip
        by_partner: dict[tuple[str, bool], dict[str, _Written]] = defaultdict(dict)
        for (writer, partner), written in sorted(found.items()):
            by_partner[partner, written.is_stranger][writer] = written
        for (partner, _), hosts in by_partner.items():
            parts = [hosts] if len(hosts) > MOST_APART else [{host: written} for host, written in hosts.items()]
            for part in parts:
                yield _finding(facts, security, part, partner, f"{protocol}/{partner}", at_least=at_least)


_Found = dict[tuple[str, str], _Written]


def _parameters(facts: Facts, allowed: _Allowed) -> tuple[_Found, bool]:
    """Return what was written by SDO, and whether there may be more of it than was kept."""
    found: _Found = defaultdict(_Written)
    kept = facts.summary.parameter_writes
    for write in kept:
        is_stranger = not allowed.lets_write(write.requester)
        if is_stranger or not allowed.lets_write_in(write.time_ns // _MINUTE_NS):
            events = Events(1, write.time_ns, write.time_ns, (write.frame,))
            name = _parameter(facts, write.partner, write.index, write.subindex)
            written = found[write.requester, write.partner]
            written.add(name, events, is_stranger=is_stranger)
            written.refused += write.error is not None
    known = facts.state.parameters.known
    if known is None:
        return found, False
    further = known.writes.further
    words = further.keys.high.tolist(), further.keys.low.view("int64").tolist()
    for row, (pair, minute) in enumerate(zip(*words, strict=True)):
        requester, partner, _ = known.writes.ends(pair)
        is_stranger = not allowed.lets_write(requester)
        if is_stranger or not allowed.lets_write_in(minute):
            found[requester, partner].add("", events_of(further.rows, row), is_stranger=is_stranger)
    _add_unseen(facts, allowed, known.writes, found)
    return found, known.writes.further_left_out > 0


def _add_unseen(facts: Facts, allowed: _Allowed, writes: Writes, found: _Found) -> None:
    """Add writes of which nothing but the reply was captured, as at a mirror port of one direction.

    Not those of parameters that the host asked for in a request that was captured: a controller that answers with
    another Counter confirms that one.
    """
    asked = {(one.requester, one.partner, one.index << 16 | one.subindex) for one in facts.summary.parameter_writes}
    beyond = {writes.ends(pair)[:2] for pair in writes.further.keys.high.tolist()}
    pairs, parameters, minutes = writes.unseen.keys.words
    words = pairs.tolist(), parameters.tolist(), minutes.view("int64").tolist()
    for row, (pair, parameter, minute) in enumerate(zip(*words, strict=True)):
        requester, partner, _ = writes.ends(pair)
        if (requester, partner, parameter) in asked or (requester, partner) in beyond:
            continue
        is_stranger = not allowed.lets_write(requester)
        # When it was asked for is not known: it may have been in the minute before.
        if is_stranger or not (allowed.lets_write_in(minute) or allowed.lets_write_in(minute - 1)):
            name = _parameter(facts, partner, parameter >> 16, parameter & 0xFFFF)
            written, events = found[requester, partner], events_of(writes.unseen.rows, row)
            written.add(name, events, is_stranger=is_stranger)
            written.unseen += events.count


def _parameter(facts: Facts, partner: str, index: int, subindex: int) -> str:
    if facts.definition is None or facts.definition.parameters is None:
        return units.parameter(index, subindex)
    return facts.definition.parameters.name_of(partner, index, subindex)


def _variables(facts: Facts, allowed: _Allowed) -> tuple[_Found, bool]:
    """Return what was written by web visualization, and whether there may be more of it than was kept."""
    from nvscope.tracker.visu.on_demand import NAME, VisuState

    found: _Found = defaultdict(_Written)
    state = facts.state.others.get(NAME)
    if not isinstance(state, VisuState) or state.known is None:
        return found, False
    from nvscope.tracker.visu.events import VisuEvent
    from nvscope.tracker.visu.limits import Beyond

    counts = state.known
    subjects = list(counts.subjects)
    log = counts.events
    for row, (event, number) in enumerate(zip(log.keys.high.tolist(), log.keys.low.tolist(), strict=True)):
        client, server, variable = subjects[number]
        if event == VisuEvent.WRITTEN and not allowed.lets_write(client):
            found[client, server].add(variable, events_of(log.rows, row), is_stranger=True)
    minutes = counts.write_minutes
    words = minutes.keys.high.tolist(), minutes.keys.low.view("int64").tolist()
    for row, (number, minute) in enumerate(zip(*words, strict=True)):
        client, server, variable = subjects[number]
        if allowed.lets_write(client) and not allowed.lets_write_in(minute):
            found[client, server].add(variable, events_of(minutes.rows, row), is_stranger=False)
    return found, bool((counts.left_out.keys.words[0] == Beyond.WRITE_MINUTE).any())


def _finding(
    facts: Facts, security: Security, hosts: dict[str, _Written], partner: str, variable: str, *, at_least: bool
) -> Finding:  # fmt: skip
    """Return the finding of one host, or of several, with what each wrote."""
    writer, written = next(iter(hosts.items()))
    if len(hosts) > 1:
        writer, written = f"{count(len(hosts))} hosts ({first_few([*hosts])})", _together(hosts.values())
    events = written.events
    assert events is not None
    is_sdo = variable.startswith("sdo/")
    how = "by SDO" if is_sdo else "by WebVisu"
    number = f"{'at least ' if at_least else ''}{count_of(events.count, 'time')}"
    names = f" ({first_few([*written.names])})" if written.names else ""
    verb = "tried to write" if written.refused == events.count else "wrote"
    message = f"{writer} {verb} {number} to {partner} {how}{names}: "
    if written.is_stranger:
        assert security.writers is not None
        allowed = ", ".join(str(one).removesuffix("/32").removesuffix("/128") for one in security.writers)
        message += f"the project lets {f'only {allowed}' if allowed else 'nobody'} write."
    else:
        assert written.first_outside_ns is not None
        hours = ", ".join(one.text for one in security.hours)
        first = units.absolute_time(written.first_outside_ns, utc=False, digits=0)
        message += f"outside the hours {hours}, first at {first} local time."
    if written.refused:
        which = "All of it was" if written.refused == events.count else count_of(written.refused, "was", "were")
        message += f" {which} refused."
    if written.unseen:
        whose = "them" if written.unseen == events.count else f"{count(written.unseen)} of them"
        message += f" Of {whose}, nothing but the reply was captured."
    return Finding(
        WRITE_NOT_ALLOWED, message, events.count, events.first_ns, events.last_ns, events.frames,
        node=facts.node_numbers.get(writer), variable=variable, hint="" if is_sdo else _HINT_OF_PAGES,
    )  # fmt: skip


def _together(several: Iterable[_Written]) -> _Written:
    """Return what several hosts wrote."""
    found = _Written()
    for one in several:
        found.is_stranger = one.is_stranger
        found.unseen += one.unseen
        found.refused += one.refused
        found.names |= one.names
        times = [time_ns for time_ns in (found.first_outside_ns, one.first_outside_ns) if time_ns is not None]
        found.first_outside_ns = min(times, default=None)
        found.events = one.events if found.events is None or one.events is None else found.events.among(one.events)
    return found
