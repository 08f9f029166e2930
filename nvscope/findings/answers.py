"""NV3xx: acknowledgements and boot-up requests, and what came back as undeliverable."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.tracker.event_kinds import EventKind
from nvscope.units import count, count_of, duration

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts, Logged, Place
    from nvscope.tracker.summary import ListSummary

NO_ACKNOWLEDGEMENT = FindingKind(
    "NV301",
    "no-acknowledgement",
    Severity.ERROR,
    meaning=(
        "The sender asked for an acknowledgement, and none was seen before its next telegram or within the timeout. A "
        "controller then counts NOACKNOWLEDGEMENT. One reader's answer would have been enough: none of them answered."
    ),
    causes=(
        "no reader is running, or none reads this list from this port",
        "the capture point does not see the answers: they are unicast to the sender, so a switch shows them only "
        "where the sender's or the reader's port is mirrored",
        "a firewall on the way back: answers go to the port of the list, not to the port a telegram came from",
        "the sender sends more often than the reader's task runs, so the answer comes after the next telegram",
        "a partner that cannot acknowledge, as most PC libraries",
    ),
    next_steps=(
        "Read nErrorCount and nAcknowledges on the sender: if they are fine, only the capture point is wrong.",
        "Check that a reader is in RUN, and has the list with the same identifier, port and acknowledgement.",
        "Lengthen the sending interval beyond the readers' task cycles, or mirror the sender's port.",
        "If no reader can acknowledge, switch acknowledgement off in the sender's list.",
    ),
    from_event=EventKind.NO_ACKNOWLEDGEMENT,
)
NEGATIVE_ACKNOWLEDGEMENT = FindingKind(
    "NV302",
    "negative-acknowledgement",
    Severity.ERROR,
    meaning=(
        "A reader rejected a telegram: it answered with the flag for an invalid checksum. It did not take the values."
    ),
    causes=(
        "the definition of the list differs between sender and reader: a variable added, removed, moved, of "
        "another type or STRING length",
        "only one of the projects was built and downloaded after a change",
        "two senders with different definitions of one list (NV401, NV403)",
    ),
    next_steps=(
        "Export the list on the sender's side (link to file), import it in the reader, build both, download both.",
        "Compare the checksum signatures of the senders in this report.",
    ),
    from_event=EventKind.NEGATIVE_ACKNOWLEDGEMENT,
)
UNEXPECTED_ACKNOWLEDGEMENT = FindingKind(
    "NV303",
    "unexpected-acknowledgement",
    Severity.NOTE,
    meaning="An acknowledgement was seen to which no telegram belongs that asked for one within the timeout before it.",
    causes=(
        "the telegram itself is missing in the capture, while its answer is there",
        "a reader so slow that it answers after the timeout",
        "a reader that acknowledges whether it is asked or not",
    ),
    next_steps=(
        "Check that the capture holds both directions of the conversation, and for gaps of the sender (NV201).",
        "If answers are always late, compare the reader's task cycle with the timeout.",
    ),
    from_event=EventKind.UNEXPECTED_ACKNOWLEDGEMENT,
)
BOOT_UP_UNANSWERED = FindingKind(
    "NV304",
    "boot-up-unanswered",
    Severity.ERROR,
    meaning=(
        "A reader that had just started asked for the current values, and no writer of the list sent them in time. It "
        "works with its initial values until the next regular telegram, for a list sent on change perhaps for long."
    ),
    causes=(
        "the writer's list does not have the option to answer boot-up requests",
        "the writer is off, stopped, or starts later than the reader",
        "the request does not reach the writer: other port, router, VLAN, firewall",
    ),
    next_steps=(
        "Switch on the answer to boot-up requests in the writing list (V2.3: properties of the list).",
        "If the writer starts after the reader, add a slow cyclic transmission to a list sent on change.",
    ),
    from_event=EventKind.BOOT_UP_UNANSWERED,
)
SEND_REJECTED = FindingKind(
    "NV305",
    "send-rejected",
    Severity.ERROR,
    meaning=(
        "A device answered a telegram with ICMP 'destination unreachable'. This happens to unicast only: nobody "
        "answers a broadcast like that, so lost broadcasts stay silent."
    ),
    causes=(
        "port unreachable: the host is there, but nothing listens on that port; its program is stopped, or "
        "configured for another port",
        "host or network unreachable: a router knows no way, or the device is off",
        "administratively prohibited: a firewall",
    ),
    next_steps=(
        "Read the ICMP code (`nvscope packets -Y 'icmp.type == 3 || icmpv6.type == 1'`): it says which of these it is, "
        "and its source says who noticed.",
        "Start the reader, or correct the address or port in the sender's list.",
    ),
    from_event=EventKind.SEND_REJECTED,
)


def judge_answers(facts: Facts) -> Iterator[Finding]:
    """Yield what went wrong with answers, by list, node and SubIndex.

    Where the limit of streams has left out what was to come, nobody knows that it is missing.
    """
    lists = {entry.number: entry for entry in facts.summary.lists}
    misses = {
        NO_ACKNOWLEDGEMENT: facts.misses_acknowledgements,
        UNEXPECTED_ACKNOWLEDGEMENT: facts.misses_data,
        BOOT_UP_UNANSWERED: facts.misses_data,
    }
    for kind, sentence in _SENTENCES.items():
        for list_number, node, subindex, events in _logged(facts, kind):
            assert list_number is not None
            if kind in misses and misses[kind](list_number):
                continue
            message = sentence(facts, lists[list_number], node, subindex, events)
            yield Finding(
                kind, message, events.count, events.first_ns, events.last_ns, events.frames,
                list_number, node, subindex,
            )  # fmt: skip


def _logged(facts: Facts, kind: FindingKind) -> list[Logged]:
    """Return the events of a kind by place; whom a reader speaks of is not known where other senders are left out."""
    logged = facts.logged(kind)
    if kind is not NEGATIVE_ACKNOWLEDGEMENT:
        return logged
    blamed: dict[Place, Events] = {}
    for list_number, node, subindex, events in logged:
        assert list_number is not None
        place = (list_number, None if facts.misses_data(list_number) else node, subindex)
        blamed[place] = blamed[place].among(events) if place in blamed else events
    return [(*place, events) for place, events in blamed.items()]


def _missing(facts: Facts, entry: ListSummary, node: int | None, subindex: int | None, events: Events) -> str:
    telegrams = facts.telegrams_of.get((entry.number, node, subindex), 0)
    acknowledged = entry.diagnosis.nAcknowledges
    rest = (
        "no acknowledgement of the list was seen at all"
        if not acknowledged
        else (f"{count_of(acknowledged, 'acknowledgement')} of the list were seen")
    )
    return f"{count(events.count)} of {count_of(telegrams, 'telegram')} stayed without acknowledgement; {rest}."


def _negative(facts: Facts, entry: ListSummary, node: int | None, subindex: int | None, events: Events) -> str:
    readers = ", ".join(facts.address(reader) for reader in entry.readers[:3])
    return (
        f"{count_of(events.count, 'negative acknowledgement')}: a reader ({readers}) finds the checksum of this list's "
        "definition different from its own."
    )


def _unexpected(facts: Facts, entry: ListSummary, node: int | None, subindex: int | None, events: Events) -> str:
    timeout = duration(facts.summary.timeout_ns)
    return f"{count_of(events.count, 'acknowledgement')} that nobody had asked for in the {timeout} before."


def _unanswered(facts: Facts, entry: ListSummary, node: int | None, subindex: int | None, events: Events) -> str:
    asked = entry.counters["bootup_requests"] or 0
    timeout = duration(facts.summary.timeout_ns)
    return (
        f"{count(events.count)} of the list's {count_of(asked, 'boot-up request')} brought no data telegram "
        f"within {timeout}."
    )


def _rejected(facts: Facts, entry: ListSummary, node: int | None, subindex: int | None, events: Events) -> str:
    return (
        f"{count_of(events.count, 'telegram')} came back as undeliverable (ICMP destination unreachable): "
        "nobody listens at the port, or there is no way to it."
    )


_SENTENCES = {
    NO_ACKNOWLEDGEMENT: _missing,
    NEGATIVE_ACKNOWLEDGEMENT: _negative,
    UNEXPECTED_ACKNOWLEDGEMENT: _unexpected,
    BOOT_UP_UNANSWERED: _unanswered,
    SEND_REJECTED: _rejected,
}
