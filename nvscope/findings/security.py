"""NV961 and NV963: who sends what the project gives to others, and two devices that use one address.

Of all that is about security: what needs the project's word is silent without it. What goes by the traffic alone is
told where nothing simpler than a stranger explains what was seen, as a router, a second way, a copy, a device that has
another address since, or a reader that begins would.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.enumeration import first_few
from nvscope.findings.finding import Finding
from nvscope.findings.kind import MOST_APART, FindingKind, Severity
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.tracker.evidence.shared_devices import SharedAddress
    from nvscope.tracker.stream_summary import StreamSummary
    from nvscope.tracker.summary import ListSummary

UNKNOWN_WRITER = FindingKind(
    "NV961",
    "unknown-writer",
    Severity.ERROR,
    meaning=(
        "A node sends a list that the project gives to others: `writes` of [nodes] names who sends it, or `only_nodes` "
        "of [security] says that [nodes] names all who send any, and this one is not there. Readers take its values."
    ),
    causes=(
        "a node that was added, or got another address, and is not in the project file yet",
        "a spare controller, a copied project, or a test program on a PC",
        "somebody who should not be there",
    ),
    next_steps=(
        "Find the node by its hardware address (`nvscope packets -e ip.src -e eth.src -e nv.index`).",
        "Stop it, or name it in the project file: what it writes, in its entry in [nodes].",
    ),
    of_security=True,
)
TWO_HARDWARE_ADDRESSES = FindingKind(
    "NV963",
    "two-hardware-addresses",
    Severity.ERROR,
    meaning=(
        "One IP address is used by two devices at the same time: their frames take turns, and either both ask, or "
        "announce it, by ARP, or each counts for itself, in its lists or in its requests to the Parameter Manager; who "
        "sends neither, as a browser, is told by ARP alone. Who sends to it reaches the one or the other. A router, a "
        "mirror of both its sides, two cables of one device, and a pair of which the one takes over from the other are "
        "none of these. A device that only answers ARP in the name of another one is not told: routers and spare "
        "devices do so, too."
    ),
    causes=(
        "one address given to two devices, by hand or by a copied project",
        "a device that sends in the name of another one, and asks by ARP as that one does",
    ),
    next_steps=(
        "Find the switch port of each hardware address, and unplug the one that should not be there.",
        "Give each device an address of its own.",
    ),
    of_security=True,
)

_BOTH = 2


def judge_security(facts: Facts) -> Iterator[Finding]:
    """Yield who sends that should not, and who shares an address, as far as that is sure."""
    yield from _unknown_writers(facts)
    yield from _shared_addresses(facts)


def _unknown_writers(facts: Facts) -> Iterator[Finding]:
    """Yield the senders of lists that the project gives to others alone."""
    only_nodes = facts.security is not None and facts.security.only_nodes
    named = {listed for node in facts.nodes.values() for listed in node.writes}
    if not named and not only_nodes:
        return
    for entry in facts.summary.lists:
        own = [address for address, node in facts.nodes.items() if is_of(entry, node.writes)]
        if not own and not only_nodes:
            continue
        allowed = {*own} or facts.nodes.keys()
        streams: dict[int, list[StreamSummary]] = {}
        is_there = False
        for stream in entry.streams:
            if facts.address(stream.node) in allowed:
                is_there = True
            else:
                streams.setdefault(stream.node, []).append(stream)
        if len(streams) > MOST_APART:
            yield _unknown_writer(facts, entry, streams, own, is_there=is_there)
        else:
            for node, sent in streams.items():
                yield _unknown_writer(facts, entry, {node: sent}, own, is_there=is_there)


def is_of(entry: ListSummary, lists: tuple[tuple[int | None, int], ...]) -> bool:
    """Tell whether a list is one of those that the project names, by port and identifier."""
    return any(number == entry.key.identifier and port in (None, entry.key.port) for port, number in lists)


def _unknown_writer(
    facts: Facts, entry: ListSummary, sent: dict[int, list[StreamSummary]], own: list[str], *, is_there: bool
) -> Finding:
    """Return the finding of one node, or of several, with the streams that they send of a list."""
    streams = [stream for of_node in sent.values() for stream in of_node]
    telegrams = sum(stream.telegrams for stream in streams)
    names = [facts.address(node) for node in sent]
    who = names[0] if len(sent) == 1 else f"{count(len(sent))} nodes ({first_few(names)})"
    message = f"{who} sent {count_of(telegrams, 'telegram')} of this list: "
    hint = ""
    if own:
        message += f"the project gives it to {', '.join(own)} alone."
        if not is_there:
            hint = (
                f"{' and '.join(own)} sent nothing of it in this capture: see whether it has another address "
                "now, or is behind a router that translates addresses."
            )
    else:
        message += f"[nodes] names all who send lists, and not {'this one' if len(sent) == 1 else 'these'}."
    # Of each node, the first frame is known.
    frames = sorted(min(facts.frames_of_stream[one.stream][0] for one in of_node) for of_node in sent.values())
    return Finding(
        UNKNOWN_WRITER, message, telegrams, min(one.first_ns for one in streams), max(one.last_ns for one in streams),
        tuple(frames[:FRAMES_KEPT]), entry.number, next(iter(sent)) if len(sent) == 1 else None, hint=hint,
    )  # fmt: skip


def _shared_addresses(facts: Facts) -> Iterator[Finding]:
    """Yield addresses that two devices use at the same time."""
    for shared in facts.shared_addresses:
        if shared.is_interleaved:
            yield _shared_address(facts, shared)


def _shared_address(facts: Facts, shared: SharedAddress) -> Finding:
    from nvscope.tracker.evidence.shared_devices import hardware_text

    devices = shared.devices
    each = ", ".join(
        f"{hardware_text(one.hardware)} ({count_of(one.frames, 'frame')}, {count_of(one.alternations, 'turn')})"
        for one in devices
    )
    number = "Two" if len(devices) == _BOTH else str(len(devices))
    proof = "; ".join(shared.told_by)
    return Finding(
        TWO_HARDWARE_ADDRESSES, f"{number} hardware addresses send from {facts.address(shared.node)} in turns: {each}; "
        f"{proof}.", sum(one.alternations for one in devices), devices[1].first_ns,
        max(one.last_ns for one in devices), (devices[1].first_frame,), node=shared.node,
    )  # fmt: skip
