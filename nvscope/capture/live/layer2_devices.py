"""The interfaces of this machine where it is no Linux: as Scapy knows them, whose names are those that people know."""

from __future__ import annotations

from collections.abc import Iterable
from ipaddress import ip_address, ip_network
from typing import Any

from msgspec import Struct

from nvscope.capture.live.addresses import Address


class Layer2Device(Struct, frozen=True):
    """An interface by the ``name`` that people use; libpcap may call it otherwise. ``title`` is what it is called."""

    name: str
    kind: str
    is_up: bool
    addresses: tuple[Address, ...]
    title: str = ""


def devices() -> list[Layer2Device]:
    """Return the interfaces, in the order of the system."""
    from scapy.config import conf  # noqa: PLC0415  takes a while
    from scapy.route import Route  # noqa: PLC0415
    from scapy.route6 import Route6  # noqa: PLC0415

    networks = [(one[3], *one[:2]) for one in Route().routes] + [(one[3], *one[:2]) for one in Route6().routes]
    return [_device(one, networks) for one in sorted(conf.ifaces.data.values(), key=lambda one: one.index)]


def _device(told: Any, networks: list[tuple[Any, Any, Any]]) -> Layer2Device:
    own = {told.name, told.network_name}
    routed = [_network(address, mask) for interface, address, mask in networks if str(interface) in own]
    flags = str(told.flags or "")
    addresses = [text for version in (4, 6) for text in told.ips.get(version, ()) if text]
    return Layer2Device(
        told.name,
        "loopback" if "LOOPBACK" in flags else "Ethernet",
        "UP" in flags if flags else told.is_valid(),
        tuple(_address(text, [one for one in routed if one]) for text in addresses),
        told.description if told.description != told.name else "",
    )


def _network(address: Any, mask: Any) -> Any:
    """Return the network of a route, None for the default one, for one machine alone, and for what is none."""
    try:
        if isinstance(address, int):
            found = ip_network((address, int(mask).bit_count()), strict=False)
        else:
            found = ip_network(f"{address}/{mask}", strict=False)
    except ValueError:
        return None
    return found if 0 < found.prefixlen < found.max_prefixlen and not found.is_multicast else None


def _address(text: str, networks: Iterable[Any]) -> Address:
    """Return an address with the smallest network of a route that it lies in."""
    try:
        own = ip_address(text.partition("%")[0])
    except ValueError:
        return Address(text)
    holding = [one for one in networks if one.version == own.version and own in one]
    if not holding:
        return Address(text)
    smallest = max(holding, key=lambda one: int(one.prefixlen))
    return Address(text, smallest.prefixlen, str(smallest.broadcast_address) if own.version == 4 else "")
