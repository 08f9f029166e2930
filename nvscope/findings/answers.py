"""NV3xx: acknowledgements and boot-up requests, and what came back as undeliverable."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.findings.finding import Events, Facts, Finding
from nvscope.tracker.summary import ListSummary
from nvscope.units import count, count_of, duration


def judge_answers(facts: Facts) -> Iterator[Finding]:
    """Yield NV301 to NV305, by list, node and SubIndex."""
    lists = {entry.number: entry for entry in facts.summary.lists}
    for code, sentence in _SENTENCES.items():
        for list_number, node, subindex, events in facts.logged(code):
            assert list_number is not None
            message = sentence(facts, lists[list_number], node, subindex, events)
            yield Finding(
                f"NV{code}", message, events.count, events.first_ns, events.last_ns, events.frames,
                list_number, node, subindex,
            )  # fmt: skip


def _missing(facts: Facts, entry: ListSummary, node: int | None, subindex: int | None, events: Events) -> str:
    telegrams = sum(s.telegrams for s in entry.streams if s.node == node and s.subindex == subindex)
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


_SENTENCES = {301: _missing, 302: _negative, 303: _unexpected, 304: _unanswered, 305: _rejected}
