"""NV965: network variables from addresses where none of the plant's should be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from nvscope.enumeration import first_few
from nvscope.findings.finding import Finding
from nvscope.findings.kind import MOST_APART, FindingKind, Severity
from nvscope.tracker.event_kinds import FRAMES_KEPT
from nvscope.units import count, count_of

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts
    from nvscope.findings.sent_by_node import SentByNode

OUTSIDE_SUBNET = FindingKind(
    "NV965",
    "outside-subnet",
    Severity.WARNING,
    meaning=(
        "Network variables come from an address outside the subnets that [security] of the project names. Without "
        "`subnets` there, only a public IPv4 address is one outside, where all others that send and receive are "
        "private, and all in one recording."
    ),
    causes=(
        "a device with the address of another network, or a wrong one",
        "a router or VPN that lets telegrams in from outside",
        "telegrams with a made-up sender",
    ),
    next_steps=(
        "Find where it enters: its hardware address is its own, or that of a router.",
        "Block the port of the lists at the edge of the network; if it is to be there, name its subnet in [security].",
    ),
    of_security=True,
)
_LEAST_PRIVATE = 2
"""So many others, all of them private: with one alone, that one might be who is in the wrong place."""

_USUALLY_PRIVATE = ((0, 8), (10, 8), (127, 8), (0xAC1, 12), (0xC0A8, 16), (0xA9FE, 16), (7, 3))
"""Begins of IPv4 addresses that are not public, and their lengths in bits: all that plants usually have."""


def judge_subnets(facts: Facts) -> Iterator[Finding]:
    """Yield the nodes outside the subnets that sent telegrams of lists or requests."""
    security = facts.security
    if security is None or not security.subnets:
        from nvscope.list_key import Transport

        # In recordings given together, the others may be those of another plant; and nobody knows who was left out.
        several = facts.state.senders.mirrored.are_several
        if not several and Transport.UDP not in facts.left_out and _has_unusual(facts):
            yield from _public(facts)
        return
    from nvscope.findings.sent_by_node import sent_by_node

    why = f"outside {', '.join(str(one) for one in security.subnets)}"
    outside = {node: sent for node, sent in sent_by_node(facts).items() if security.is_outside(facts.address(node))}
    if len(outside) > MOST_APART:
        yield _finding(facts, outside, why)
    else:
        for node, sent in outside.items():
            yield _finding(facts, {node: sent}, why)


def _has_unusual(facts: Facts) -> bool:
    """Tell whether a node may have a public IPv4 address: most plants have none, and need not be looked at further."""
    import numpy as np

    from dissectors.headers import IPV4_HIGH

    high, low = facts.state.keys.nodes.words
    address = low[high == IPV4_HIGH].astype(np.uint32)
    for begin, bits in _USUALLY_PRIVATE:
        address = address[address >> np.uint32(32 - bits) != begin]
    return bool(len(address))


def _public(facts: Facts) -> Iterator[Finding]:
    """Yield a public node where all others, senders and receivers, are private."""
    import ipaddress

    from nvscope.findings.sent_by_node import receivers, sent_by_node

    sent = sent_by_node(facts)
    known = {node: ipaddress.ip_address(facts.address(node)) for node in {*sent, *receivers(facts)}}
    inside = {node: one for node, one in known.items() if isinstance(one, ipaddress.IPv4Address)}
    public = [node for node, one in inside.items() if one.is_global and node in sent]
    private = [one for one in inside.values() if one.is_private and not one.is_loopback and not one.is_unspecified]
    # A plant with public addresses has several, and nobody is outside of it.
    if len(public) != 1 or len(private) < _LEAST_PRIVATE or len(private) + 1 != len(inside):
        return
    (node,) = public
    what = f"a public address, where all {count(len(private))} others that send and receive have private ones"
    yield _finding(facts, {node: sent[node]}, what)


def _finding(facts: Facts, nodes: Mapping[int, SentByNode], why: str) -> Finding:
    """Return the finding of one node, or of several, with what they sent."""
    telegrams, requests = (sum(getattr(one, name) for one in nodes.values()) for name in ("telegrams", "requests"))
    parts = []
    if telegrams:
        parts.append(f"{count_of(telegrams, 'telegram')} of lists")
    if requests:
        parts.append(f"{count_of(requests, 'request')} of the Parameter Manager")
    hint = ""
    if broadcast := sum(one.broadcast for one in nodes.values()):
        hint = (
            f"{count(broadcast)} of them are broadcast, which routers do not let through: look for a device in "
            "this network that has the address of another one."
        )
    names = [facts.address(node) for node in nodes]
    who = names[0] if len(names) == 1 else f"{count(len(names))} nodes ({first_few(names)})"
    first, last, frames = (
        [value for one in nodes.values() if (value := getattr(one, name)) is not None]
        for name in ("first_ns", "last_ns", "frame")
    )
    return Finding(
        OUTSIDE_SUBNET, f"{who} sent {' and '.join(parts)}: {why}.", telegrams + requests, min(first, default=None),
        max(last, default=None), tuple(sorted(frames)[:FRAMES_KEPT]),
        node=next(iter(nodes)) if len(nodes) == 1 else None, hint=hint,
    )  # fmt: skip
