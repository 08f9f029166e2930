"""Hosts that ask many partners in vain for parameters: one cause a host, where each partner would have its own.

A scan asks a whole network; a program with wrong addresses, or behind a broken cable, asks a whole plant. Of few
partners each has a cause of its own, which tells more of it.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dissectors.batch import I64
from dissectors.netvar import PORT
from nvscope.causes.asked_partners import AskedPartners, Served
from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import MOST_APART
from nvscope.causes.parameters import (
    NEXT_OF_ERRORS,
    NEXT_WHERE_NOTHING_IS_SEEN,
    NEXT_WHERE_UNDELIVERABLE,
    PARAMETERS_REFUSED,
    PARAMETERS_UNANSWERED,
)
from nvscope.causes.words import span_in_words
from nvscope.engine.runs import rows_by
from nvscope.enumeration import first_few
from nvscope.findings.kind import FindingKind
from nvscope.findings.parameter import SDO_ERROR_REPLY, SDO_TIMEOUT
from nvscope.findings.scans import SCAN
from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.tracker.parameter.summary import PairSummary

_SHOWN_NODES = 8
"""So many of these partners are nodes of the cause, beside the host: made-up ones have no end."""

_NEXT = (
    "What all of them have in common: the way to them, their power, the Parameter Manager in their target settings; "
    "else the addresses and ports in the program that asks."
)
_NEXT_OF_REFUSED = (
    "What they are asked for, beside their parameter lists: the program that asks has that of other controllers, or is "
    "a tool that looks for parameters."
)

_Own = Mapping[Served, I64]


def judge_many_unanswered(case: Case) -> Iterator[Explained]:
    """Explain the requests of each host of which many partners answered none."""
    asked = AskedPartners(case)
    for asker, of_host in _by_asker(case, asked, SDO_TIMEOUT).items():
        own = {served: rows for served, rows in of_host.items() if _is_silent(case, asked, asker, served)}
        if len(own) > MOST_APART:
            yield _unanswered(case, asked, asker, own)


def judge_many_refused(case: Case) -> Iterator[Explained]:
    """Explain the requests of each host that many partners refuse alike: the same parameters, for the same reasons."""
    asked = AskedPartners(case)
    for asker, of_host in _by_asker(case, asked, SDO_ERROR_REPLY).items():
        alike: dict[tuple[frozenset[str], ...], dict[Served, I64]] = defaultdict(dict)
        for served, rows in of_host.items():
            errors = frozenset(name for one in _pairs(case, asked, asker, served) for name in one.errors)
            places = (asked.place(place) for place in set(case.symptoms.finding[rows].tolist()))
            alike[errors, frozenset(one.parameter for one in places)][served] = rows
        for own in alike.values():
            if len(own) > MOST_APART:
                yield _refused(case, asked, asker, own)


def _by_asker(case: Case, asked: AskedPartners, kind: FindingKind) -> dict[int, dict[Served, I64]]:
    """Return the symptoms of a kind that nothing has explained, by who asked whom on which port: nodes alone."""
    found: dict[int, dict[Served, I64]] = defaultdict(dict)
    every = asked.by_served(kind)
    if len(every) <= MOST_APART:
        return {}
    for served, rows in every.items():
        if not asked.is_for_all(served.partner):
            for (asker,), own in rows_by((case.symptoms.node[rows],)):
                if asker >= 0:
                    found[asker][served] = rows[own]
    return {asker: of_host for asker, of_host in found.items() if len(of_host) > MOST_APART}


def _pairs(case: Case, asked: AskedPartners, asker: int, served: Served) -> Sequence[PairSummary]:
    address = case.facts.address(asker)
    return [one for one in asked.of.get(served, ()) if one.requester == address]


def _is_silent(case: Case, asked: AskedPartners, asker: int, served: Served) -> bool:
    """Tell whether a partner sent a host no reply at all on a port."""
    return not any(one.replies or one.busy or one.unexpected for one in _pairs(case, asked, asker, served))


def _unanswered(case: Case, asked: AskedPartners, asker: int, own: _Own) -> Explained:
    rows = np.sort(np.concatenate([*own.values()]))
    since_ns, until_ns = int(case.symptoms.since_ns[rows].min()), case.end_of(case.symptoms.time_ns[rows])
    partners, when = list(dict.fromkeys(one.partner for one in own)), span_in_words(case, since_ns, until_ns)
    is_one = len(partners) == 1
    title = f"{_partners(case, asked, asker, partners)} did not answer node {case.address(asker)}, "
    title += f"which asked {'it' if is_one else 'them'} for parameters{_ports(own)} {when}"
    named = first_few([asked.name(one) for one in partners])
    checked = [f"{named}: not one reply to {count_of(len(rows), 'request')} for {asked.parameters(rows)}"]
    pairs = [one for served in own for one in _pairs(case, asked, asker, served)]
    if undeliverable := sum(one.undeliverable for one in pairs):
        checked.append(f"{count_of(undeliverable, 'request')} came back: ICMP destination unreachable")
    seen = sum(map(asked.is_seen, partners))
    if not seen:
        checked.append(f"nothing that {'it sends' if is_one else 'they send'} is in this capture")
    elif not is_one:
        checked.append(f"{count(seen)} of them {'sends' if seen == 1 else 'send'} something else")
    step = _NEXT
    scans = case.free(SCAN) & (case.symptoms.node == asker)
    if scans.any():
        checked[1:1] = [one.message.rstrip(".") for one in case.findings if one.kind is SCAN and one.node == asker]
        step = SCAN.next_steps[0]
    elif undeliverable:
        step = NEXT_WHERE_UNDELIVERABLE
    elif not seen:
        name, sends = (asked.name(partners[0]), "sends") if is_one else ("they", "send")
        step = NEXT_WHERE_NOTHING_IS_SEEN.format(partner=name, sends=sends) + step[0].lower() + step[1:]
    draft = Draft(
        PARAMETERS_UNANSWERED, title, step, checked, nodes=_nodes(asked, asker, partners), since_ns=since_ns,
        until_ns=until_ns,
    )  # fmt: skip
    return draft, case.only(rows) | scans


def _refused(case: Case, asked: AskedPartners, asker: int, own: _Own) -> Explained:
    rows = np.sort(np.concatenate([*own.values()]))
    since_ns, until_ns = int(case.symptoms.time_ns[rows].min()), case.end_of(case.symptoms.time_ns[rows])
    partners, errors = list(dict.fromkeys(one.partner for one in own)), Counter[str]()
    for served in own:
        for one in _pairs(case, asked, asker, served):
            errors.update(one.errors)
    most = errors.most_common(1)[0][0] if errors else ""
    does = "refuses" if len(partners) == 1 else "refuse"
    title = f"{_partners(case, asked, asker, partners)} {does} requests of node {case.address(asker)} for "
    title += f"{asked.parameters(rows)}{_ports(own)} {span_in_words(case, since_ns, until_ns)}"
    draft = Draft(
        PARAMETERS_REFUSED, title, NEXT_OF_ERRORS.get(most, _NEXT_OF_REFUSED),
        [f"{first_few([asked.name(one) for one in partners])} refuse them alike",
         *(f"{name}: {count_of(times, 'time')}" for name, times in errors.most_common())],
        nodes=_nodes(asked, asker, partners), since_ns=since_ns, until_ns=until_ns,
    )  # fmt: skip
    return draft, case.only(rows)


def _partners(case: Case, asked: AskedPartners, asker: int, partners: Sequence[str]) -> str:
    """Return how many partners of all that a host asked: ``237 of 249 partners``; of one, its name."""
    if len(partners) == 1:
        return f"Node {asked.name(partners[0])}"
    every = len(asked.asked_alone[case.facts.address(asker)])
    of = f"{count(len(partners))} of " if every > len(partners) else ""
    return of + count_of(max(every, len(partners)), "partner")


def _ports(own: _Own) -> str:
    ports = {one.port for one in own}
    if len(ports) > 1:
        return f" on {count(len(ports))} ports"
    return "" if ports == {PORT} else f" on port {min(ports)}"


def _nodes(asked: AskedPartners, asker: int, partners: Sequence[str]) -> list[int]:
    numbers = [number for number in map(asked.number, partners) if number is not None]
    return [asker, *numbers[:_SHOWN_NODES]]
