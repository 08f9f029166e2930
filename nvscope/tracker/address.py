"""Addresses as two 64-bit halves, IPv4 mapped into the lower one, and back to what a person reads."""

from __future__ import annotations

from ipaddress import IPv4Address, IPv6Address

from dissectors.link import MAPPED_IPV4

_MAPPED = int(MAPPED_IPV4)


def is_ipv4(high: int, low: int) -> bool:
    """Tell whether an address is an IPv4 one."""
    return high == 0 and low >> 32 == _MAPPED >> 32


def text(high: int, low: int) -> str:
    """Return the usual text of an address."""
    if is_ipv4(high, low):
        return str(IPv4Address(low & 0xFFFFFFFF))
    return str(IPv6Address(high << 64 | low))


def order(high: int, low: int) -> tuple[bool, int]:
    """Return a key that sorts addresses by number, IPv4 before IPv6."""
    if is_ipv4(high, low):
        return False, low & 0xFFFFFFFF
    return True, high << 64 | low
