"""The table of checks, in the order in which they explain that nothing is seen: the first problem is the likeliest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum

from msgspec import Struct

from nvscope.doctor import addresses, clock, firewall, interfaces, multicast, paths, permissions, ports, telegrams
from nvscope.doctor.case import Case
from nvscope.doctor.result import Result


class Where(StrEnum):
    """What a check looks at: this machine, or traffic, which may be that of a file."""

    MACHINE = "machine"
    TRAFFIC = "traffic"


class Check(Struct, frozen=True):
    """``looks_at`` is what is judged, in words that go on behind the title."""

    name: str
    title: str
    looks_at: str
    where: Where
    judge: Callable[[Case], Iterator[Result]]


_M, _T = Where.MACHINE, Where.TRAFFIC

CHECKS: Sequence[Check] = (
    Check(interfaces.NAME, "interfaces", "whether one is up and has a carrier", _M, interfaces.judge_interfaces),
    Check(telegrams.OTHER_PORTS, "other ports", "telegrams where nobody expects them", _T, telegrams.judge_other_ports),
    Check(telegrams.IDENTITY_CHECK, "identity", "datagrams that are almost telegrams", _T, telegrams.judge_identity),
    Check(paths.VLAN, "VLAN", "tags that keep telegrams from programs", _T, paths.judge_vlan),
    Check(addresses.NAME, "addresses", "netmasks against broadcast addresses and nodes", _M, addresses.judge_addresses),
    Check(telegrams.LISTS, "lists", "what came against the definitions", _T, telegrams.judge_lists),
    Check(paths.UNREACHABLE, "sent back", "nodes that take no telegram (ICMP)", _T, paths.judge_unreachable),
    Check(ports.NAME, "ports", "who has the UDP ports", _M, ports.judge_ports),
    Check(firewall.NAME, "firewall", "rules, and whether telegrams reach programs", _M, firewall.judge_firewall),
    Check(multicast.NAME, "multicast", "whether groups are joined", _M, multicast.judge_multicast),
    Check(paths.CONVERSATIONS, "conversations", "what is for one station alone", _T, paths.judge_conversations),
    Check(paths.ARP, "ARP", "addresses that nobody has", _T, paths.judge_arp),
    Check(paths.ROUTERS, "routers", "senders in other networks", _T, paths.judge_routers),
    Check(permissions.NAME, "permissions", "whether this user may capture", _M, permissions.judge_permissions),
    Check(telegrams.TELEGRAMS, "telegrams", "whether any came", _T, telegrams.judge_telegrams),
    Check(clock.NAME, "clock", "whether it is set, and follows a server", _M, clock.judge_clock),
)
