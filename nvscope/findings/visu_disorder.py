"""NV810: connections of web visualization that were captured in another order than that of the wire."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.findings.finding import Events, Finding, all_events
from nvscope.findings.kind import FindingKind, Severity
from nvscope.units import count_of

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.visu.state import VisuCounts

VISU_DISORDER = FindingKind(
    "NV810",
    "visu-disorder",
    Severity.NOTE,
    meaning=(
        "Packets of web visualization pages lie behind what acknowledges them: they were captured in another order "
        "than that of the wire. They are put in order again where nothing comes more than 100 ms, or 128 packets, "
        "late. How long replies took is wrong by as much as two clocks differ, and not known where it would be less "
        "than nothing."
    ),
    causes=(
        "two captures, one of each direction, by clocks that differ, merged into one",
        "a test access point or bond with two interfaces, each with time stamps of its own",
        "several queues of a network card, or a mirror port that delays one direction",
    ),
    next_steps=(
        "Capture both directions at one interface, or by one clock.",
        "Move one capture by the difference before both are merged: editcap -t, then mergecap.",
    ),
    protocol="visu",
)


def judge_disorder(facts: Facts, counts: VisuCounts) -> Iterator[Finding]:
    """Yield a finding for each client and server of pages whose connections have shown it."""
    from dissectors import address

    found: dict[tuple[str, str], Events] = {}
    log, messages = counts.disorder, counts.messages() if len(counts.disorder.keys) else {}
    for *halves, events in zip(*(word.tolist() for word in log.keys.words), all_events(log.rows), strict=True):
        ends = address.text(*halves[:2]), address.text(*halves[2:4])
        if messages.get(ends):
            found[ends] = found[ends].among(events) if ends in found else events
    nodes = {text: number for number, text in enumerate(facts.summary.addresses)}
    for (client, server), events in found.items():
        were = "was" if events.count == 1 else "were"
        yield Finding(
            VISU_DISORDER,
            f"{count_of(events.count, 'connection')} of {client} to {server} {were} captured in another order than "
            "that of the wire: packets lie behind what acknowledges them.",
            events.count, events.first_ns, events.last_ns, events.frames,
            node=nodes.get(client), variable=f"visu/{server}",
        )  # fmt: skip
