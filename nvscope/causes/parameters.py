"""What partners do not answer of the Parameter Manager, or refuse."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.causes.asked_partners import AskedPartners
from nvscope.causes.case import Case, Draft, Explained
from nvscope.causes.kind import CauseKind
from nvscope.causes.words import capitalised, span_in_words
from nvscope.engine.runs import distinct
from nvscope.enumeration import first_few
from nvscope.findings.parameter import SDO_ERROR_REPLY, SDO_TIMEOUT, SDO_UNEXPECTED_REPLY
from nvscope.tracker.parameter.events import place_of
from nvscope.units import count_of, duration

if TYPE_CHECKING:
    from nvscope.tracker.parameter.summary import PairSummary

PARAMETERS_UNANSWERED = CauseKind(
    "parameters-unanswered",
    "requests unanswered",
    "A node did not answer requests of the Parameter Manager, or not in time.",
    "Requests (services 1 and 3) after which no reply came within the timeout. Replies that came later belong to it. "
    "More than eight partners, or ports, from which a host gets no reply at all are one.",
    "Whether its program runs, and whether the Parameter Manager is on in its target settings, on this port.",
)
PARAMETERS_REFUSED = CauseKind(
    "parameters-refused",
    "requests refused",
    "A node answers requests of the Parameter Manager with an error.",
    "Replies of services 20 to 28, which say what they refuse. More than eight partners that refuse the same to a host "
    "are one.",
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
    "Whether this capture sees what {partner} {sends}: a mirror port of one direction shows no replies. If it does: "
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


class _Unanswered(Struct, frozen=True):
    """Requests to a partner, or to everybody, that nobody answered in time, and what came behind them.

    ``rows`` are those of their symptoms. ``stray`` are symptoms of replies that ended no request of these: those that
    were ``late``, and others.
    """

    partner: str
    rows: I64
    pairs: Sequence[PairSummary]
    stray: Bool
    late: Bool
    is_for_all: bool
    is_seen: bool

    @property
    def others(self) -> int:
        """How many replies came that were to none of these requests."""
        return int(np.count_nonzero(self.stray & ~self.late))

    @property
    def is_answered(self) -> bool:
        """Whether the partner answered anything in time."""
        return any(one.replies or one.busy for one in self.pairs)

    @property
    def came_back(self) -> int:
        """How many ICMP messages say that a request went nowhere."""
        return sum(one.undeliverable for one in self.pairs)

    @property
    def is_late(self) -> bool:
        """Whether more than half of them were answered too late."""
        return 2 * int(np.count_nonzero(self.late)) > len(self.rows)

    @property
    def has_another_counter(self) -> bool:
        """Whether as many were answered with a Counter that is not theirs, and none with theirs."""
        return 2 * self.others > len(self.rows) and not self.is_answered


_NEXT: Sequence[tuple[Callable[[_Unanswered], object], str]] = (
    (lambda one: one.is_for_all, NEXT_OF_BROADCASTS),
    (lambda one: one.came_back, NEXT_WHERE_UNDELIVERABLE),
    (lambda one: one.has_another_counter, NEXT_OF_OTHER_COUNTERS),
    (lambda one: one.is_late, NEXT_OF_LATE),
    (lambda one: not one.is_seen, NEXT_WHERE_NOTHING_IS_SEEN),
)
"""When which step is the next one: the first that applies; where none does, that of the kind."""


def judge_unanswered_parameters(case: Case) -> Iterator[Explained]:
    """Explain requests that nobody answered in time, and late replies to them, by partner and port."""
    symptoms, asked = case.symptoms, AskedPartners(case)
    for served, rows in asked.by_served(SDO_TIMEOUT).items():
        since_ns, until_ns = int(symptoms.since_ns[rows].min()), case.end_of(symptoms.time_ns[rows])
        is_for_all = asked.is_for_all(served.partner)
        stray = case.free(SDO_UNEXPECTED_REPLY) & np.isin(symptoms.finding, _replies_to(case, rows, is_for_all))
        stray &= symptoms.time_ns >= since_ns
        # What was asked for, and given up, has begun before.
        late = stray & (symptoms.since_ns != symptoms.time_ns)
        is_seen = is_for_all or asked.is_seen(served.partner)
        one = _Unanswered(served.partner, rows, asked.of.get(served, ()), stray, late, is_for_all, is_seen)
        what, when = f"{asked.what(rows)}{asked.on_port(served)}", span_in_words(case, since_ns, until_ns)
        draft = Draft(
            PARAMETERS_UNANSWERED, _title(asked, one, what, when), _step(one),
            list((_checked_of_all if is_for_all else _checked)(case, asked, one)),
            nodes=asked.nodes(rows, [served.partner]), since_ns=since_ns, until_ns=until_ns,
        )  # fmt: skip
        yield draft, case.only(rows) | stray


def _title(asked: AskedPartners, one: _Unanswered, what: str, when: str) -> str:
    number, every = len(one.rows), sum(pair.requests for pair in one.pairs)
    requests = f"{count_of(number, 'request')} {what}"
    # Of those that may still be answered when the capture ends, nothing is to be said.
    if every > number and one.is_answered:
        requests = f"{number} of {count_of(every, 'request')}, {'that' if number == 1 else 'those'} {what},"
    if not one.is_for_all:
        return f"Node {asked.name(one.partner)} did not answer {requests} {when}"
    if one.others:
        return f"{capitalised(requests)} went to everybody, {one.partner}, {when}"
    return f"Nobody answered {requests} to {one.partner} {when}"


def _step(one: _Unanswered) -> str:
    usual = PARAMETERS_UNANSWERED.next_step
    step = next((step for applies, step in _NEXT if applies(one)), usual)
    if step is NEXT_WHERE_NOTHING_IS_SEEN:
        return step.format(partner=one.partner, sends="sends") + usual[0].lower() + usual[1:]
    return step


def _checked_of_all(case: Case, asked: AskedPartners, one: _Unanswered) -> Iterator[str]:
    yield "they go to everybody: it is one node that is asked for a parameter"
    if one.others:
        places = distinct(case.symptoms.finding[one.stray]).tolist()
        partners = sorted({asked.place(place).partner for place in places})
        yield f"{count_of(one.others, 'reply', 'replies')} came, of {first_few([*map(asked.name, partners)])}"


def _checked(case: Case, asked: AskedPartners, one: _Unanswered) -> Iterator[str]:
    if replies := sum(pair.replies for pair in one.pairs):
        slowest = max((pair.latency.maximum or 0 for pair in one.pairs), default=0)
        yield f"it answered {count_of(replies, 'other')}, the slowest after {duration(slowest)}"
    else:
        yield "it answered none"
    if one.came_back:
        yield f"{count_of(one.came_back, 'request')} came back: ICMP destination unreachable"
    if one.late.any():
        slowest = int((case.symptoms.time_ns - case.symptoms.since_ns)[one.late].max())
        number = int(np.count_nonzero(one.late))
        yield f"{count_of(number, 'reply', 'replies')} came after the timeout, the slowest after {duration(slowest)}"
    if one.others:
        yield f"{count_of(one.others, 'reply', 'replies')} came with a Counter of which no request was open"
    if not one.is_seen:
        yield "nothing that it sends is in this capture"
        return
    node = asked.number(one.partner)
    sends = node is not None and any(node in entry.senders for entry in case.facts.summary.lists)
    yield "it sends lists" if sends else "it sends no list"


def _replies_to(case: Case, rows: I64, is_for_all: bool) -> list[int]:
    """Return the findings of unexpected replies that are about what some symptoms are about, by whomever if all were.

    Who was asked with all others answers in its own name.
    """

    def about(place: int) -> tuple[object, ...]:
        one = case.findings[place]
        asked = place_of(one.variable)
        return one.node, asked.port, asked.parameter, None if is_for_all else asked.partner

    sought = {about(place) for place in distinct(case.symptoms.finding[rows]).tolist()}
    return [
        place for place, one in enumerate(case.findings) if one.kind is SDO_UNEXPECTED_REPLY and about(place) in sought
    ]  # fmt: skip


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
    for place in distinct(case.symptoms.finding[chosen]).tolist():
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
    symptoms, asked = case.symptoms, AskedPartners(case)
    for served, rows in asked.by_served(SDO_ERROR_REPLY).items():
        pairs = asked.of.get(served, ())
        since_ns, until_ns = int(symptoms.time_ns[rows].min()), case.end_of(symptoms.time_ns[rows])
        errors: Counter[str] = Counter()
        for one in pairs:
            errors.update(one.errors)
        most = errors.most_common(1)[0][0] if errors else ""
        good = sum(one.replies - sum(one.errors.values()) for one in pairs)
        checked = [f"{name}: {count_of(count, 'time')}" for name, count in errors.most_common()]
        checked.append(f"it answered {count_of(good, 'other request')}" if good else "it answered nothing else")
        when, refused = span_in_words(case, since_ns, until_ns), count_of(len(rows), "request")
        what = f"{asked.what(rows)}{asked.on_port(served)}"
        draft = Draft(
            PARAMETERS_REFUSED, f"Node {asked.name(served.partner)} refuses {refused} {what} {when}",
            NEXT_OF_ERRORS.get(most, PARAMETERS_REFUSED.next_step), checked,
            nodes=asked.nodes(rows, [served.partner]), since_ns=since_ns, until_ns=until_ns,
        )  # fmt: skip
        yield draft, case.only(rows)
