"""What becomes of a packet in the chains of a firewall, in a logic of three values: where a rule asks for something
that is not known of the packet, both of its ways are taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum, Flag, auto

from msgspec import Struct

_DEEPEST = 16


class Fate(Enum):
    """What becomes of a packet."""

    ACCEPTED = "accepted"
    DROPPED = "dropped"
    DEPENDS = "depends"


class Ways(Flag):
    """Ways that a packet may take from a rule or chain."""

    NONE = 0
    ACCEPT = auto()
    DROP = auto()
    ON = auto()
    RETURN = auto()


class Packet(Struct, frozen=True):
    """The first telegram of somebody: it comes in by an interface ("": whichever), to a port."""

    interface: str
    port: int


class Rule(Struct, frozen=True):
    """``holds``: whether its conditions do, None where nobody knows. ``ways`` it gives, and chains it may call."""

    holds: bool | None
    ways: Ways
    calls: tuple[str, ...] = ()
    is_goto: bool = False


class Chain(Struct, frozen=True):
    """Rules in order; ``policy`` is what becomes of a packet behind the last one, None of a chain that is called.

    Each rule is asked with the packet, since what it says hangs on that.
    """

    rules: Sequence[RuleText]
    policy: Ways | None = None


class RuleText:
    """A rule as its firewall writes it."""

    def of(self, packet: Packet) -> Rule:
        """Return what it says to a packet."""
        raise NotImplementedError


Chains = Mapping[str, Chain]


def fate_of(chains: Chains, packet: Packet) -> Fate:
    """Return what becomes of a packet that has to pass all chains with a policy, one after the other."""
    fates = []
    for name, chain in chains.items():
        if chain.policy is None:
            continue
        ways = _through(chains, name, packet, 0)
        if ways & (Ways.ON | Ways.RETURN):
            ways = ways & (Ways.ACCEPT | Ways.DROP) | chain.policy
        fates.append(ways)
    if any(ways == Ways.DROP for ways in fates):
        return Fate.DROPPED
    return Fate.DEPENDS if any(Ways.DROP in ways for ways in fates) else Fate.ACCEPTED


def _through(chains: Chains, name: str, packet: Packet, depth: int) -> Ways:
    """Return how a packet may leave a chain; ``ON`` and ``RETURN``: to where it was called from."""
    chain = chains.get(name)
    if chain is None or depth > _DEEPEST:
        return Ways.ACCEPT | Ways.DROP | Ways.ON
    taken = Ways.NONE
    for text in chain.rules:
        rule = text.of(packet)
        if rule.holds is False:
            continue
        ways = rule.ways
        for called in rule.calls:
            inner = _through(chains, called, packet, depth + 1)
            back = inner & (Ways.ON | Ways.RETURN)
            ways |= inner & (Ways.ACCEPT | Ways.DROP)
            if back:
                ways |= Ways.RETURN if rule.is_goto else Ways.ON
        taken |= ways & ~Ways.ON
        if rule.holds and Ways.ON not in ways:
            return taken
    return taken | Ways.ON
