"""Addresses: do those that lists are sent to, and those of the nodes, fit the netmasks of this machine?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from ipaddress import IPv4Address, IPv4Interface

from nvscope.doctor.case import Case, ipv4
from nvscope.doctor.expected import EVERYBODY
from nvscope.doctor.facts.machine import Interface, Machine
from nvscope.doctor.result import Result, State
from nvscope.enumeration import first_few
from nvscope.units import count_of

NAME = "addresses"


def judge_addresses(case: Case) -> Iterator[Result]:
    """Judge the targets of the definitions and those that were seen, and the nodes of the project."""
    machine = case.machine
    if machine is None or machine.interfaces is None:
        yield Result(NAME, State.UNKNOWN, "the addresses of this machine are not known on this system")
        return
    targets = list(_targets(case, machine))
    masks_wrong = {result.about for result in targets if result.state is State.PROBLEM}
    found = [
        *_twins(case), *targets, *_neighbours(case, masks_wrong), *_nodes(case, machine), *_twice(machine),
    ]  # fmt: skip
    yield from found
    if any(result.state is State.PROBLEM for result in found):
        return
    own = [
        f"{entry.name} {own} (broadcast {own.network.broadcast_address})"
        for entry in case.interfaces for own in entry.addresses
    ]  # fmt: skip
    told = f"of this machine: {first_few(own)}" if own else "no interface has one, and none is needed to capture"
    yield Result(NAME, State.OK, told)


def _twins(case: Case) -> Iterator[Result]:
    """Judge addresses of this machine that another device has, too, which the telegrams from there tell."""
    twins: dict[str, set[str]] = {}
    for flow, _ in case.flows:
        if case.is_twin(flow):
            twins.setdefault(flow.source, set()).add(flow.hardware)
    for source, hardware in sorted(twins.items()):
        yield Result(
            NAME, State.PROBLEM,
            f"{source} is an address of this machine, and of another device: its telegrams come from "
            f"{first_few(sorted(hardware))}",
            f"give this machine another address in that network (`ip addr del {source}/BITS dev NAME`, then add one): "
            "what is for one of both comes to the other, too", source, f"{source} is an address of this machine, too",
        )  # fmt: skip


def _targets(case: Case, machine: Machine) -> Iterator[Result]:
    """Judge broadcast addresses: of a network that this machine takes for larger or smaller, it is another address."""
    told: dict[IPv4Address, str] = {
        one.address: f"{one.told} is sent to" for one in case.expected.targets if _is_subnet(one.address)
    }
    seen: Counter[IPv4Address] = Counter()
    senders: dict[IPv4Address, set[str]] = {}
    for flow, times in case.foreign:
        target = ipv4(flow.target)
        # The link layer says of what was captured whether it went to all; so it must, whatever its netmask is here.
        if target is not None and flow.to_all and not target.is_multicast and target != EVERYBODY:
            seen[target] += times
            senders.setdefault(target, set()).add(flow.source)
    for target, times in sorted(seen.items()):
        told[target] = f"{count_of(times, 'telegram')} of {first_few(sorted(senders[target]))} went to"
    for target, words in told.items():
        if case.is_subnet(target):
            continue
        place = next(iter(machine.networks_of(target)), None) or _smaller(machine, target)
        if place is not None:
            yield _of_another_mask(target, words, *place)
        elif target not in seen and machine.own - {IPv4Address("127.0.0.1")}:
            yield Result(
                NAME, State.NOTE if case.heard else State.PROBLEM,
                f"{words} {target}, which is in no network of this machine ({_own(case)})",
                f"give the interface at that network an address of it: `ip addr add ADDRESS/24 dev "
                f"{_some_interface(case)}`; broadcasts do not cross routers", str(target),
                f"{target} is in no network of this machine",
            )  # fmt: skip
        elif target in seen:
            yield Result(
                NAME, State.NOTE, f"{words} {target}, the broadcast address of a network that this machine is not in",
                "a capture sees them (-i NAME); programs on this machine, and udp://, do not get them", str(target),
            )  # fmt: skip


def _smaller(machine: Machine, target: IPv4Address) -> tuple[Interface, IPv4Interface] | None:
    """Return an interface whose network is a part of one that has this broadcast address, such as /25 of a /24."""
    for entry in machine.interfaces or ():
        for own in entry.addresses:
            bits = next((n for n in range(8, own.network.prefixlen) if _broadcast(own, n) == target), None)
            if bits is not None and not entry.is_loopback:
                return entry, own
    return None


def _broadcast(own: IPv4Interface, bits: int) -> IPv4Address:
    return own.network.supernet(new_prefix=bits).broadcast_address


def _of_another_mask(target: IPv4Address, words: str, entry: Interface, own: IPv4Interface) -> Result:
    fits = next((n for n in range(30, 7, -1) if IPv4Interface(f"{own.ip}/{n}").network.broadcast_address == target), 24)
    return Result(
        NAME, State.PROBLEM,
        f"{words} {target}, and {entry.name} is {own}, whose broadcast address is {own.network.broadcast_address}: "
        "programs on this machine do not take them",
        f"give both sides one netmask: here `ip addr add {own.ip}/{fits} dev {entry.name}` and "
        f"`ip addr del {own} dev {entry.name}`, if that of the senders is right; a capture sees them anyway (-i "
        f"{entry.name})", entry.name, f"the netmask of {entry.name} (/{own.network.prefixlen}) does not fit {target}",
    )  # fmt: skip


def _neighbours(case: Case, told: Collection[str]) -> Iterator[Result]:
    """Judge senders on this wire whose address is of another network; not by interfaces whose netmask is told wrong."""
    strange: dict[str, set[str]] = {}
    for flow, _ in case.foreign:
        interface = case.interface_of(flow)
        to_all = ipv4(flow.target) == EVERYBODY
        if to_all and interface is not None and interface.name not in told and case.is_elsewhere(flow):
            strange.setdefault(interface.name, set()).add(flow.source)
    for name, sources in strange.items():
        yield Result(
            NAME, State.NOTE,
            f"{first_few(sorted(map(case.expected.name_of, sources)))} broadcast{'s' if len(sources) == 1 else ''} on "
            f"the wire of {name}, from an address in no network of it",
            f"programs here may not get that (reverse-path filter), and cannot answer: give {name} an address in that "
            f"network, `ip addr add ADDRESS/24 dev {name}`, or correct the one of the sender", name,
        )  # fmt: skip


def _nodes(case: Case, machine: Machine) -> Iterator[Result]:
    """Judge nodes of the project that are in no network of this machine, and of which nothing came."""
    heard = {flow.source for flow, _ in case.foreign}
    far = [
        text for text in case.expected.nodes
        if (node := ipv4(text)) and text not in heard and node not in machine.own and not machine.networks_of(node)
    ]  # fmt: skip
    if far and any(entry.addresses for entry in case.interfaces):
        yield Result(
            NAME, State.NOTE if case.heard else State.PROBLEM,
            f"in no network of this machine ({_own(case)}): "
            f"{first_few([case.expected.name_of(text) for text in far])}; nothing came of it",
            f"broadcasts do not cross routers: give the interface an address in that network, `ip addr add ADDRESS/24 "
            f"dev {_some_interface(case)}`, or capture there", far[0], f"{far[0]} is in no network of this machine",
        )  # fmt: skip


def _twice(machine: Machine) -> Iterator[Result]:
    """Judge networks that two interfaces are in: what is sent goes out by one of them."""
    places: dict[object, list[str]] = {}
    for entry in machine.interfaces or ():
        for own in entry.addresses:
            if entry.is_usable and own.network.prefixlen < 31 and entry.name not in places.get(own.network, []):
                places.setdefault(own.network, []).append(entry.name)
    for network, entries in places.items():
        if len(entries) > 1:
            yield Result(
                NAME, State.NOTE, f"in one network, {network}: {first_few(entries)}",
                "answers of this machine go out by one of them only: give each interface a network of its own",
                entries[0],
            )  # fmt: skip


def _is_subnet(address: IPv4Address) -> bool:
    """Return whether an address looks like the broadcast address of a network; one of a node hardly ends so."""
    return address != EVERYBODY and not address.is_multicast and str(address).endswith(".255")


def _own(case: Case) -> str:
    return first_few([entry.told for entry in case.interfaces if entry.addresses]) or "it has no address"


def _some_interface(case: Case) -> str:
    usable = [entry.name for entry in case.interfaces if entry.is_usable]
    return usable[0] if usable else "NAME"
