"""This machine, as far as it matters for what comes in: interfaces, sockets, groups, clock, permission.

All is read from the kernel, without privileges and without a word on the network.
"""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Sequence
from functools import cached_property
from ipaddress import IPv4Address, IPv4Interface

from msgspec import Struct

from nvscope.capture.live.device import device_of, hardware_of, names, state_of
from nvscope.doctor.facts.clock import ClockState, clock_state
from nvscope.doctor.facts.firewall import Firewall, firewall
from nvscope.doctor.facts.groups import Membership, memberships
from nvscope.doctor.facts.interface_addresses import addresses
from nvscope.doctor.facts.sockets import BoundPort, bound_ports, looked_into

LINUX = sys.platform.startswith("linux")


class Interface(Struct, frozen=True):
    """An interface and its IPv4 addresses; ``vlan`` is the tag that it adds and takes away, None without one.

    ``hardware`` is its address on the wire, "" where it has none or nobody tells.
    """

    name: str
    is_up: bool
    has_carrier: bool
    is_loopback: bool
    is_ethernet: bool
    is_physical: bool
    addresses: tuple[IPv4Interface, ...] = ()
    vlan: int | None = None
    hardware: str = ""

    @property
    def is_usable(self) -> bool:
        """Whether something may come in by it from others."""
        return self.is_up and self.has_carrier and not self.is_loopback

    @property
    def told(self) -> str:
        """The interface with its addresses, as people write them."""
        return f"{self.name} ({', '.join(map(str, self.addresses)) or 'no IPv4 address'})"


class Machine(Struct, frozen=True, dict=True):
    """What was found; None where this system does not tell."""

    interfaces: Sequence[Interface] | None
    bound: Sequence[BoundPort] | None
    groups: Sequence[Membership] | None
    clock: ClockState | None
    firewall: Firewall
    may_capture: bool | None

    @cached_property
    def own(self) -> frozenset[IPv4Address]:
        """The IPv4 addresses of this machine."""
        return frozenset(one.ip for entry in self.interfaces or () for one in entry.addresses)

    @cached_property
    def hardware(self) -> frozenset[str]:
        """The addresses on the wire of this machine, as far as they are known."""
        return frozenset(entry.hardware for entry in self.interfaces or () if entry.hardware)

    @cached_property
    def outward(self) -> Sequence[Interface]:
        """The interfaces through which others can be reached, were they up."""
        return [entry for entry in self.interfaces or () if not entry.is_loopback and entry.is_ethernet]

    def interface(self, name: str) -> Interface | None:
        """Return an interface by its name, None where there is none."""
        return next((entry for entry in self.interfaces or () if entry.name == name), None)

    def networks_of(self, address: IPv4Address) -> Sequence[tuple[Interface, IPv4Interface]]:
        """Return the interfaces in whose network an address lies, each with its own address there."""
        return [
            (entry, own) for entry in self.interfaces or () for own in entry.addresses
            if address in own.network and not entry.is_loopback
        ]  # fmt: skip


def look(ports: Sequence[int]) -> Machine:
    """Look at this machine; ``ports`` are those of which more is wanted: their holders, and what the firewall does."""
    interfaces = _interfaces() if LINUX else None
    return Machine(
        interfaces, looked_into(bound_ports(), ports) if LINUX else None, memberships() if LINUX else None,
        clock_state() if LINUX else None,
        firewall(ports, [entry.name for entry in interfaces or () if entry.is_usable]) if LINUX else Firewall(),
        _may_capture() if LINUX else None,
    )  # fmt: skip


def interfaces_now() -> Sequence[Interface] | None:
    """Return the interfaces as they are now; None where this system does not tell."""
    return _interfaces() if LINUX else None


def _interfaces() -> Sequence[Interface]:
    known, tags = addresses(), _vlan_tags()
    found = []
    for name in names():
        device, state = device_of(name), state_of(name)
        if device is None or state is None:
            continue
        found.append(
            Interface(
                name, state.is_up, state.has_carrier, device.is_loopback,
                device.is_known and device.is_ethernet and not device.is_loopback, _is_physical(name),
                tuple(known.get(device.index, ())), tags.get(name), hardware_of(name),
            )
        )  # fmt: skip
    return found


def _is_physical(name: str) -> bool:
    return os.path.exists(f"/sys/class/net/{name}/device")


def _vlan_tags() -> dict[str, int]:
    """Return the tags of interfaces that are the VLAN of another one."""
    try:
        with open("/proc/net/vlan/config", encoding="ascii", errors="replace") as file:
            rows = [[cell.strip() for cell in line.split("|")] for line in file]
    except OSError:
        return {}
    return {row[0]: int(row[1]) for row in rows if len(row) == 3 and row[1].isdigit()}


def _may_capture() -> bool | None:
    try:
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0).close()
    except PermissionError:
        return False
    except OSError:
        return None
    return True
