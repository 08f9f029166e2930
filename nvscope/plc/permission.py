"""Where it may be sent to: this machine, unless somebody says that it may be others."""

from __future__ import annotations

import ipaddress
import os

from nvscope.capture.live.can.word import CanWord
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


def is_own_bus(where: CanWord) -> bool:
    """Tell whether nobody but programs of this machine is on a CAN bus."""
    if where.interface == "udp_multicast":
        return where.options.get("hop_limit") == 0
    if where.interface == "socketcan":
        # Adapters of a serial line are called as one likes, and have no device either.
        device = os.path.realpath(f"/sys/class/net/{where.channel}")
        return where.channel.startswith("vcan") and "/virtual/" in device
    return where.interface == "virtual"


def refuse_bus(word: str) -> UsageError:
    """Return that frames would get to other nodes, and nobody allowed that."""
    return UsageError(
        f"{word[:80]} may have other nodes on it, and nothing is sent to others unless that is allowed",
        next_step="--allow-network sends on it: drives may take what comes; a vcan interface is this machine's alone",
    )
