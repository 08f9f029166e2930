"""What should come: ports, lists, addresses they are sent to, and nodes, as project, definitions and sources say."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Mapping

from msgspec import Struct, field

from dissectors.netvar import PORT
from nvscope.capture.live.udp_socket import UdpAddress
from nvscope.definition.project import Project
from nvscope.enumeration import first_few
from nvscope.list_key import ListKey
from nvscope.units import list_key

IPv4 = ipaddress.IPv4Address
EVERYBODY = IPv4("255.255.255.255")


class Target(Struct, frozen=True):
    """An address that lists are sent to, by their definitions."""

    address: IPv4
    lists: tuple[str, ...]

    @property
    def told(self) -> str:
        """The lists as people read them, of many the first one."""
        return first_few(self.lists, 1)


class Expected(Struct, frozen=True):
    """What should come.

    ``ports`` are never empty; ``said`` tells whether somebody named them, or the usual one is taken. ``groups`` are
    multicast groups, also those of sources. ``nodes`` are names by address.
    """

    ports: tuple[int, ...] = (PORT,)
    said: bool = False
    lists: Mapping[ListKey, str] = field(default_factory=dict)
    targets: tuple[Target, ...] = ()
    groups: tuple[str, ...] = ()
    nodes: Mapping[str, str] = field(default_factory=dict)

    @property
    def told_ports(self) -> str:
        """The ports as people read them: ``UDP 1202``."""
        return f"UDP {', '.join(map(str, self.ports))}"

    def name_of(self, address: str) -> str:
        """Return an address with the name of its node in front, if it has one."""
        name = self.nodes.get(address, "")
        return f"{name} ({address})" if name else address


def expected_of(project: Project, sources: Iterable[UdpAddress] = ()) -> Expected:
    """Return what a project and its definitions, and plain sockets that were named, let expect on UDP."""
    entries = {key: entry for key, entry in project.definition.by_key().items() if isinstance(key.port, int)}
    sockets = tuple(sources)
    said = {int(key.port) for key in entries} | {socket.port for socket in sockets}
    said |= set(project.ports) if project.path is not None and (project.ports != (PORT,) or not said) else set()
    names = {key: f"{entry.name} ({list_key(str(key))})" if entry.name else list_key(str(key))
             for key, entry in entries.items()}  # fmt: skip
    sent: dict[IPv4, list[str]] = {}
    for key, entry in entries.items():
        try:
            sent.setdefault(IPv4(entry.address.strip()), []).append(names[key])
        except ValueError:
            continue  # the definition says it, and `gvl lint` what is wrong with it
    targets = tuple(Target(address, tuple(lists)) for address, lists in sorted(sent.items()))
    groups = {str(target.address) for target in targets if target.address.is_multicast}
    groups |= {group for socket in sockets for group in socket.groups}
    nodes = {address: node.name for address, node in project.nodes.items()}
    return Expected(
        tuple(sorted(said or {PORT})), bool(said), names, targets, tuple(sorted(groups)), nodes
    )  # fmt: skip
