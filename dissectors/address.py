"""Addresses as two 64-bit halves, as the dissectors give them, and back to what a person reads."""

from __future__ import annotations

from ipaddress import IPv6Address, ip_address

from dissectors.headers import IPV4_HIGH, IPV4_LOW

_HIGH, _LOW = int(IPV4_HIGH), int(IPV4_LOW)


def is_ipv4(high: int, low: int) -> bool:
    """Tell whether an address is an IPv4 one."""
    return high == _HIGH and low & _LOW == _LOW


def text(high: int, low: int) -> str:
    """Return the usual text of an address."""
    if is_ipv4(high, low):
        return f"{low >> 24 & 0xFF}.{low >> 16 & 0xFF}.{low >> 8 & 0xFF}.{low & 0xFF}"
    return str(IPv6Address(high << 64 | low))


def halves(address: str) -> tuple[int, int]:
    """Return the halves of an address that ``text`` wrote; ValueError where it is none."""
    number = ip_address(address)
    return (_HIGH, _LOW | int(number)) if number.version == 4 else divmod(int(number), 1 << 64)


def order(high: int, low: int) -> tuple[bool, int]:
    """Return a key that sorts addresses by number, IPv4 before IPv6."""
    if is_ipv4(high, low):
        return False, low & 0xFFFFFFFF
    return True, high << 64 | low
