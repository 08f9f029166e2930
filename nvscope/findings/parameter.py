"""NV7xx: the Parameter Manager's requests and replies."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding, all_events
from nvscope.findings.kind import FindingKind, Severity
from nvscope.units import count_of, duration

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.parameter.transactions import Asked

SDO_TIMEOUT = FindingKind(
    "NV701",
    "sdo-timeout",
    Severity.ERROR,
    meaning="A Parameter Manager request was not answered within the timeout (500 ms unless the caller chose another).",
    causes=(
        "the partner is off, stopped, or has no network variables support in its target settings",
        "a wrong partner address or port in the call, or the address of a broadcast",
        "a firewall, or a capture point that sees only one direction",
    ),
    next_steps=(
        "Check whether the partner sends anything at all in this capture.",
        "Check the address given to the function block, and that both sides use the same port.",
    ),
)
SDO_ERROR_REPLY = FindingKind(
    "NV702",
    "sdo-error-reply",
    Severity.ERROR,
    meaning="The partner answered a Parameter Manager request with an error; the service of the reply says which.",
    causes=(
        "ODErrorReplyIdx: the partner has no such index",
        "ODErrorReplyLen or ODErrorReplyItems: size or number of elements differ from the partner's entry",
        "ODErrorReplyAccess: the entry cannot be read, or not be written",
        "ODErrorReplyCPUStopped: the partner's program does not run",
    ),
    next_steps=("Compare index, subindex, length and items of the request with the partner's parameter list.",),
)
SDO_UNEXPECTED_REPLY = FindingKind(
    "NV703",
    "sdo-unexpected-reply",
    Severity.WARNING,
    meaning="A Parameter Manager reply was seen that belongs to no open request.",
    causes=(
        "the request is missing in the capture",
        "a reply that came after the timeout: the caller has given up, and may have asked again",
        "a request that was sent again and answered each time, or a partner that answers twice",
        "two callers that use the same address",
    ),
    next_steps=(
        "Look whether its request timed out before (NV701), and check that the capture holds both directions.",
    ),
)
SDO_SLOW = FindingKind(
    "NV704",
    "sdo-slow",
    Severity.NOTE,
    meaning="Parameter Manager replies took a large part of the timeout.",
    causes=(
        "a long task cycle in the partner: requests are answered once per cycle",
        "many requests at the same time",
    ),
    next_steps=("Compare with the partner's task cycle; lengthen the timeout, or ask less often.",),
)


def judge_parameters(facts: Facts) -> Iterator[Finding]:
    """Yield a finding for each parameter of a partner and port that was asked for, if something is to be said of it."""
    known = facts.state.parameters.known
    if known is None:
        return
    from nvscope.tracker.parameter.events import event_parts

    found: dict[tuple[int, Asked], list[tuple[int, Events]]] = defaultdict(list)
    for log in (known.events, *([known.overdue_events(facts.at_ns)] if facts.overdue else ())):
        for word, number, events in zip(
            log.keys.high.tolist(), log.keys.low.tolist(), all_events(log.rows), strict=True
        ):
            event, service = event_parts(word)
            found[event, known.described(number)].append((service, events))
    nodes = {text: number for number, text in enumerate(facts.summary.addresses)}
    for (event, asked), parts in found.items():
        yield _finding(facts, nodes, event, asked, parts, known.timeout_ns)


def _finding(
    facts: Facts, nodes: Mapping[str, int], event: int, asked: Asked, parts: list[tuple[int, Events]], timeout_ns: int
) -> Finding:  # fmt: skip
    from dissectors.netvar import Service
    from nvscope.tracker.parameter.events import ParameterEvent, partner_name, variable_name

    together = parts[0][1]
    for _, events in parts[1:]:
        together = together.among(events)
    timeout, partner = duration(timeout_ns), partner_name(asked.partner, asked.port)
    ends = f"{asked.requester} for {_called(facts, asked)}"
    if event == ParameterEvent.TIMEOUT:
        kind, requests = SDO_TIMEOUT, f"{count_of(together.count, 'request')} of {ends}"
        message = f"{partner} did not answer {requests} within {timeout}."
        # What goes to one alone makes it a node.
        if asked.partner not in nodes:
            message = f"{requests} went to everybody, {partner}, and to no one controller: no reply comes from there."
    elif event == ParameterEvent.ERROR_REPLY:
        kind = SDO_ERROR_REPLY
        counts: Counter[str] = Counter()
        for service, events in sorted(parts, key=lambda part: part[0]):
            counts[Service(service).name] += events.count
        names = ", ".join(f"{name} ({count})" for name, count in counts.items())
        message = f"{partner} refused {count_of(together.count, 'request')} of {ends}: {names}."
    elif event == ParameterEvent.SLOW:
        kind = SDO_SLOW
        message = (
            f"{partner} took more than {duration(timeout_ns // 2)} for "
            f"{count_of(together.count, 'reply', 'replies')} to {ends}, half of the timeout."
        )
    else:
        kind = SDO_UNEXPECTED_REPLY
        late = sum(events.count for is_late, events in parts if is_late)
        message = f"{count_of(together.count, 'reply', 'replies')} of {partner} to {ends}: no such request was open"
        message += f"; {late} came after the timeout." if late else "."
    return Finding(
        kind, message, together.count, together.first_ns, together.last_ns, together.frames,
        node=nodes.get(asked.requester),
        variable=variable_name(asked.partner, asked.port, asked.name),
    )  # fmt: skip


def _called(facts: Facts, asked: Asked) -> str:
    """Return the name of a parameter with its place, or without a name the place alone."""
    if facts.definition is None or facts.definition.parameters is None:
        return asked.name
    name = facts.definition.parameters.name_of(asked.partner, asked.index, asked.subindex)
    return name if name == asked.name else f"{name} ({asked.name})"
