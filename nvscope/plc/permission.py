"""Where it may be sent to: this machine, unless somebody says that it may be others."""

from __future__ import annotations

import ipaddress
import os

from nvscope.capture.live.can.word import CanWord
from nvscope.errors import UsageError

_LOCAL = "127.0.0.1"


def address_of(text: str, example: str = "for example udp://127.0.0.1:1202") -> str:
    """Return an address as it is used; UsageError for what is none, names but localhost among it.

    ``example`` says what to do then.
    """
    if text == "localhost":
        return _LOCAL
    try:
        return str(ipaddress.ip_address(text.strip("[]")))
    except ValueError:
        raise UsageError(f"{text[:80]}: expected an IP address, or localhost", next_step=example) from None


def is_loopback(address: str) -> bool:
    """Tell whether what is sent there stays on this machine."""
    return ipaddress.ip_address(address).is_loopback


def refuse_network(address: str) -> UsageError:
    """Return that something would leave this machine, and nobody allowed that."""
    return UsageError(
        f"{address} is not this machine, and nothing is sent to others unless that is allowed",
        next_step="--allow-network sends to it: plant controllers may take what comes; or name 127.0.0.1",
    )


_NETWORKS = "127.0.0.0/8 10.0.0.0/8 172.16.0.0/12 192.168.0.0/16 169.254.0.0/16 ::1 fc00::/7 fe80::/10"
_NEAR = tuple(ipaddress.ip_network(text) for text in _NETWORKS.split())
"""This machine, and networks that routers of others lead nobody to: private ones (RFC 1918, 4193), and link-local."""


def is_near(address: str) -> bool:
    """Tell whether an address is of this machine, or of a private network."""
    one = plain_address(address)
    return any(one in network for network in _NEAR)


def plain_address(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """Return an address by which a node is known: without an interface, and IPv4 where it is that within IPv6."""
    one = ipaddress.ip_address(address.partition("%")[0])
    return one.ipv4_mapped or one if isinstance(one, ipaddress.IPv6Address) else one


def refuse_far(address: str) -> UsageError:
    """Return that something would leave this machine and private networks, and nobody allowed that."""
    return UsageError(
        f"{address} is neither this machine nor in a private network, and nothing is sent to others unless that is "
        "allowed",
        next_step="--allow-network sends to it: look twice whether the address is that of the controller",
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
