"""NV965: network variables from addresses where none of the plant's should be."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
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
        "private."
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


def judge_subnets(facts: Facts) -> Iterator[Finding]:
    """Yield each node outside the subnets that sent telegrams of lists or requests."""
    security = facts.security
    if security is None or not security.subnets:
        yield from _public(facts)
        return
    from nvscope.findings.sent_by_node import sent_by_node

    named = ", ".join(str(one) for one in security.subnets)
    for node, sent in sent_by_node(facts).items():
        if security.is_outside(facts.address(node)):
            yield _finding(facts, node, sent, f"outside {named}")


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
    yield _finding(facts, node, sent[node], what)


def _finding(facts: Facts, node: int, sent: SentByNode, why: str) -> Finding:
    parts = []
    if sent.telegrams:
        parts.append(f"{count_of(sent.telegrams, 'telegram')} of lists")
    if sent.requests:
        parts.append(f"{count_of(sent.requests, 'request')} of the Parameter Manager")
    hint = ""
    if sent.broadcast:
        hint = (
            f"{count(sent.broadcast)} of them are broadcast, which routers do not let through: look for a device in "
            "this network that has the address of another one."
        )
    return Finding(
        OUTSIDE_SUBNET, f"{facts.address(node)} sent {' and '.join(parts)}: {why}.", sent.telegrams + sent.requests,
        sent.first_ns, sent.last_ns, () if sent.frame is None else (sent.frame,), node=node, hint=hint,
    )  # fmt: skip
