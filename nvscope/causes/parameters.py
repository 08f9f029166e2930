"""What partners do not answer of the Parameter Manager, or refuse."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from ipaddress import ip_address
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.netvar import PORT
from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import capitalised, span_in_words
from nvscope.engine.runs import distinct
from nvscope.enumeration import first_few
from nvscope.findings.kind import FindingKind
from nvscope.findings.parameter import SDO_ERROR_REPLY, SDO_TIMEOUT, SDO_UNEXPECTED_REPLY
from nvscope.tracker.parameter.events import Place, place_of
from nvscope.units import count_of, duration

if TYPE_CHECKING:
    from nvscope.tracker.parameter.summary import PairSummary

PARAMETERS_UNANSWERED = CauseKind(
    "parameters-unanswered",
    "requests unanswered",
    "A node did not answer requests of the Parameter Manager, or not in time.",
    "Requests (services 1 and 3) after which no reply came within the timeout. Replies that came later belong to it.",
    "Whether its program runs, and whether the Parameter Manager is on in its target settings, on this port.",
)
PARAMETERS_REFUSED = CauseKind(
    "parameters-refused",
    "requests refused",
    "A node answers requests of the Parameter Manager with an error.",
    "Replies of services 20 to 28, which say what they refuse.",
    "Index, SubIndex, size and number of elements of the request, beside the parameter list of that node.",
)

NEXT_OF_ERRORS = {
    "ODErrorReplyIdx": "The Index that is asked for: the partner's parameter list has none of that number.",
    "ODErrorReplySub": "The SubIndex that is asked for: the partner's parameter has none of that number.",
    "ODErrorReplyAccess": "Whether the partner's parameter may be read, or written: its list says that it may not.",
    "ODErrorReplyLen": "The size of the value: the partner's parameter is of another type.",
    "ODErrorReplyItems": "The number of elements: the partner's parameter has another one.",
    "ODErrorReplyCPUStopped": "Its run/stop switch and the state of its application: its program does not run.",
}
NEXT_WHERE_UNDELIVERABLE = (
    "What the ICMP messages say (`nvscope packets -Y 'icmp || icmpv6'`): port unreachable, that its program does not "
    "listen on that port; host or network unreachable, that nobody has that address."
)
NEXT_WHERE_NOTHING_IS_SEEN = (
    "Whether this capture sees what {partner} sends: a mirror port of one direction shows no replies. If it does: "
)
NEXT_OF_OTHER_COUNTERS = (
    "The Counter in its replies (`nvscope packets -Y sdo -e sdo.index -e nv.counter`): who asks takes a reply that "
    "repeats that of the request."
)
NEXT_OF_LATE = (
    "Its task cycle, in each of which it answers once, and the TimeOut of the function block that asks: its replies "
    "come, and too late."
)
NEXT_OF_BROADCASTS = "The address of the partner, in the program that asks: it has to be that of the controller."
_OF_BROADCASTS = ".255"
_NAMED = 3


class _Served(NamedTuple):
    """Who is asked, on which port: a controller may serve on one and not on another."""

    partner: str
    port: int


def judge_unanswered_parameters(case: Case) -> Iterator[Explained]:
    """Explain requests that nobody answered in time, and late replies to them, by partner and port."""
    symptoms = case.symptoms
    for served, own in _by_served(case, SDO_TIMEOUT).items():
        pairs = _pairs(case, served)
        since_ns, until_ns = int(symptoms.since_ns[own].min()), case.end_of(symptoms.time_ns[own])
        is_for_all = _is_for_all(case, served.partner)
        stray = case.free(SDO_UNEXPECTED_REPLY) & np.isin(symptoms.finding, _replies_to(case, own, is_for_all))
        stray &= symptoms.time_ns >= since_ns
        # What was asked for, and given up, has begun before.
        late = stray & (symptoms.since_ns != symptoms.time_ns)
        others = int(np.count_nonzero(stray & ~late))
        asked = sum(one.requests for one in pairs)
        what = f"{_what(case, own)}{_on(case, served)}"
        requests = f"{count_of(len(own), 'request')} {what}"
        # Of those that may still be answered when the capture ends, nothing is to be said.
        if asked > len(own) and any(one.replies or one.busy for one in pairs):
            those = "that" if len(own) == 1 else "those"
            requests = f"{len(own)} of {count_of(asked, 'request')}, {those} {what},"
        when = span_in_words(case, since_ns, until_ns)
        title = f"{_name(case, served.partner)} did not answer {requests} {when}"
        step = PARAMETERS_UNANSWERED.next_step
        is_seen = is_for_all or _is_seen(case, served.partner)
        checked = list(_checked(case, served.partner, pairs, late, others, is_seen=is_seen))
        if any(one.undeliverable for one in pairs):
            step = NEXT_WHERE_UNDELIVERABLE
        elif 2 * others > len(own) and not any(one.replies or one.busy for one in pairs):
            step = NEXT_OF_OTHER_COUNTERS
        elif 2 * int(np.count_nonzero(late)) > len(own):
            step = NEXT_OF_LATE
        elif not is_seen:
            step = NEXT_WHERE_NOTHING_IS_SEEN.format(partner=served.partner) + step[0].lower() + step[1:]
        if is_for_all:
            title, step = f"Nobody answered {requests} to {served.partner} {when}", NEXT_OF_BROADCASTS
            checked = ["they go to everybody: it is one node that is asked for a parameter"]
            if others:
                title = f"{capitalised(requests)} went to everybody, {served.partner}, {when}"
                checked.append(f"{count_of(others, 'reply', 'replies')} came, of {_repliers(case, stray)}")
        draft = Draft(
            PARAMETERS_UNANSWERED, title, step, checked,
            nodes=_nodes(case, own, served.partner), since_ns=since_ns, until_ns=until_ns,
        )  # fmt: skip
        yield draft, case.only(own) | stray


def _is_for_all(case: Case, address: str) -> bool:
    """Tell whether an address is no node's, but that of a broadcast or multicast."""
    is_group = ip_address(address).is_multicast or address.endswith(_OF_BROADCASTS)
    return is_group and _number(case, address) is None


def copied_replies(case: Case) -> Bool:
    """Tell which unexpected replies are copies of replies, where all telegrams came twice.

    They are of pairs of nodes whose replies that close requests are as many, those that are known to be copies set
    aside, and are about what was answered in time.
    """
    chosen = case.free(SDO_UNEXPECTED_REPLY)
    if not chosen.any():
        return chosen
    pairs = {(one.requester, one.partner, one.port): one for one in case.facts.summary.parameters}
    late = {(one.node, one.variable) for one in case.findings if one.kind is SDO_TIMEOUT}
    for place in _distinct(case, np.flatnonzero(chosen)):
        one = case.findings[place]
        asked = place_of(one.variable)
        pair = pairs.get((case.facts.address(one.node) if one.node is not None else "", asked.partner, asked.port))
        # What is known to be copied, requests and replies alike, ends nothing and is not unexpected.
        most = pair.replies + pair.busy - pair.copies // 2 if pair is not None else 0
        if pair is None or pair.unexpected > most or (one.node, one.variable) in late:
            chosen &= case.symptoms.finding != place
    return chosen


def judge_refused_parameters(case: Case) -> Iterator[Explained]:
    """Explain error replies, by partner and port."""
    symptoms = case.symptoms
    for served, own in _by_served(case, SDO_ERROR_REPLY).items():
        pairs = _pairs(case, served)
        since_ns, until_ns = int(symptoms.time_ns[own].min()), case.end_of(symptoms.time_ns[own])
        errors: Counter[str] = Counter()
        for one in pairs:
            errors.update(one.errors)
        most = errors.most_common(1)[0][0] if errors else ""
        good = sum(one.replies - sum(one.errors.values()) for one in pairs)
        checked = [f"{name}: {count_of(count, 'time')}" for name, count in errors.most_common()]
        checked.append(f"it answered {count_of(good, 'other request')}" if good else "it answered nothing else")
        when, refused = span_in_words(case, since_ns, until_ns), count_of(len(own), "request")
        what = f"{_what(case, own)}{_on(case, served)}"
        draft = Draft(
            PARAMETERS_REFUSED, f"{_name(case, served.partner)} refuses {refused} {what} {when}",
            NEXT_OF_ERRORS.get(most, PARAMETERS_REFUSED.next_step), checked, nodes=_nodes(case, own, served.partner),
            since_ns=since_ns, until_ns=until_ns,
        )  # fmt: skip
        yield draft, case.only(own)


def _is_seen(case: Case, partner: str) -> bool:
    """Tell whether anything that a node sends is in the capture, or anything of others says that it is there."""
    for one in case.facts.summary.parameters:
        came = one.replies or one.busy or one.unexpected or one.undeliverable
        if (came and one.partner == partner) or (one.requests and one.requester == partner):
            return True
    node = _number(case, partner)
    return node is not None and (node in case.streams_of_node or case.life.is_heard(node))


def _repliers(case: Case, stray: Bool) -> str:
    """Return the names of who sent some unexpected replies."""
    partners = {place_of(case.findings[place].variable).partner for place in _distinct(case, np.flatnonzero(stray))}
    numbers = [(one, _number(case, one)) for one in sorted(partners)]
    return first_few([one if number is None else case.address(number) for one, number in numbers], _NAMED)


def _checked(
    case: Case, partner: str, pairs: Sequence[PairSummary], late: Bool, others: int, *, is_seen: bool
) -> Iterator[str]:
    replies = sum(one.replies for one in pairs)
    if replies:
        slowest = max((one.latency.maximum or 0 for one in pairs), default=0)
        yield f"it answered {count_of(replies, 'other')}, the slowest after {duration(slowest)}"
    else:
        yield "it answered none"
    if undeliverable := sum(one.undeliverable for one in pairs):
        yield f"{count_of(undeliverable, 'request')} came back: ICMP destination unreachable"
    if late.any():
        slowest = int((case.symptoms.time_ns - case.symptoms.since_ns)[late].max())
        number = int(np.count_nonzero(late))
        yield f"{count_of(number, 'reply', 'replies')} came after the timeout, the slowest after {duration(slowest)}"
    if others:
        yield f"{count_of(others, 'reply', 'replies')} came with a Counter of which no request was open"
    if not is_seen:
        yield "nothing that it sends is in this capture"
        return
    node = _number(case, partner)
    sends = node is not None and any(node in entry.senders for entry in case.facts.summary.lists)
    yield "it sends lists" if sends else "it sends no list"


def _by_served(case: Case, kind: FindingKind) -> dict[_Served, I64]:
    """Return the symptoms of a kind that nothing has explained, by who was asked on which port."""
    found: dict[_Served, list[int]] = defaultdict(list)
    for row in np.flatnonzero(case.free(kind)).tolist():
        place = _place(case, row)
        found[_Served(place.partner, place.port)].append(row)
    return {served: np.array(rows, np.int64) for served, rows in found.items()}


def _place(case: Case, row: int) -> Place:
    return place_of(case.findings[int(case.symptoms.finding[row])].variable)


def _replies_to(case: Case, own: I64, is_for_all: bool) -> list[int]:
    """Return the findings of unexpected replies that are about what some symptoms are about, by whomever if all were.

    Who was asked with all others answers in its own name.
    """

    def about(place: int) -> tuple[object, ...]:
        one = case.findings[place]
        asked = place_of(one.variable)
        return one.node, asked.port, asked.parameter, None if is_for_all else asked.partner

    sought = {about(place) for place in _distinct(case, own)}
    return [
        place for place, one in enumerate(case.findings) if one.kind is SDO_UNEXPECTED_REPLY and about(place) in sought
    ]  # fmt: skip


def _distinct(case: Case, own: I64) -> list[int]:
    places: list[int] = distinct(case.symptoms.finding[own]).tolist()
    return places


def _what(case: Case, own: I64) -> str:
    """Return who asked for what: ``of press for 0x2000:1``."""
    found = [case.findings[place] for place in _distinct(case, own)]
    nodes = list(dict.fromkeys(case.address(one.node) for one in found if one.node is not None))
    names = list(dict.fromkeys(_called(case, one.variable) for one in found))
    asking = f"of {', '.join(nodes[:_NAMED])} " if nodes else ""
    return f"{asking}for {first_few(names, _NAMED)}"


def _called(case: Case, variable: str) -> str:
    """Return the name of a finding's parameter, or without a name Index and SubIndex."""
    place = place_of(variable)
    index, subindex = place.parameter.split(":")
    known = case.facts.definition and case.facts.definition.parameters
    return known.name_of(place.partner, int(index, 16), int(subindex)) if known else place.parameter


def _pairs(case: Case, served: _Served) -> Sequence[PairSummary]:
    return [one for one in case.facts.summary.parameters if (one.partner, one.port) == served]


def _on(case: Case, served: _Served) -> str:
    """Return on which port a partner was asked, "" where it is the usual one and no other was tried."""
    ports = {one.port for one in case.facts.summary.parameters if one.partner == served.partner}
    return "" if {served.port} | ports == {PORT} else f" on port {served.port}"


def _number(case: Case, address: str) -> int | None:
    addresses = case.facts.summary.addresses
    return addresses.index(address) if address in addresses else None


def _name(case: Case, address: str) -> str:
    node = _number(case, address)
    return f"Node {address if node is None else case.address(node)}"


def _nodes(case: Case, own: I64, partner: str) -> list[int]:
    """Return the numbers of who was asked, and of who asked."""
    node = _number(case, partner)
    return list(dict.fromkeys([*([] if node is None else [node]), *asking_nodes(case, own)]))


def asking_nodes(case: Case, own: I64 | Bool) -> list[int]:
    """Return the numbers of who asked, rising, as far as these are nodes."""
    return [node for node in distinct(case.symptoms.node[own]).tolist() if node >= 0]
