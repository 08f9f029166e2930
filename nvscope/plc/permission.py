"""Where it may be sent to: this machine, unless somebody says that it may be others."""

from __future__ import annotations

import ipaddress

from nvscope.errors import UsageError

_LOCAL = "127.0.0.1"


def address_of(text: str) -> str:
    """Return an address as it is used; UsageError for what is none, names but localhost among it."""
    if text == "localhost":
        return _LOCAL
    try:
        return str(ipaddress.ip_address(text.strip("[]")))
    except ValueError:
        raise UsageError(
            f"{text[:80]}: expected an IP address, or localhost", next_step="for example udp://127.0.0.1:1202"
        ) from None


def is_loopback(address: str) -> bool:
    """Tell whether what is sent there stays on this machine."""
    return ipaddress.ip_address(address).is_loopback


def refuse_network(address: str) -> UsageError:
    """Return that something would leave this machine, and nobody allowed that."""
    return UsageError(
        f"{address} is not this machine, and nothing is sent to others unless that is allowed",
        next_step="--allow-network sends to it: plant controllers may take what comes; or name 127.0.0.1",
    )
