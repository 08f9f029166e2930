"""What the checks judge: what should come, this machine, and what came."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from ipaddress import AddressValueError, IPv4Address, IPv4Interface

from msgspec import Struct

from nvscope.doctor.expected import EVERYBODY, Expected
from nvscope.doctor.facts.machine import Interface, Machine
from nvscope.doctor.facts.traffic import Flow, ListenedTo, Stranger, Traffic
from nvscope.doctor.result import State


class Case(Struct, frozen=True, dict=True):
    """``machine`` is None where files were read. ``listened_ns`` is how long it was
    listened, None of files, and where nobody could.

    ``asks_sockets``: somebody named a plain socket, and what it gets is the question.
    Telegrams are counted where all is seen that passes; what plain sockets got says what reaches programs.
    """

    expected: Expected
    traffic: Traffic
    places: Sequence[ListenedTo]
    machine: Machine | None = None
    listened_ns: int | None = None
    asked_interfaces: Sequence[str] = ()
    asks_sockets: bool = False

    @cached_property
    def sees_all(self) -> bool:
        """Whether somewhere all was seen that passed."""
        return any(place.sees_all and not self._is_deaf(number) for number, place in enumerate(self.places))

    def _is_deaf(self, number: int) -> bool:
        return bool(self.places[number].failure) and not self.traffic.frames[number]

    @cached_property
    def flows(self) -> Sequence[tuple[Flow, int]]:
        """All telegrams; where both were heard, those of plain sockets are the same once more, and left out."""
        found = self.traffic.flows.items()
        return [(flow, times) for flow, times in found if self.places[flow.place].sees_all or not self.sees_all]

    @property
    def places_open(self) -> bool:
        """Whether it was listened anywhere at all."""
        return any(not place.failure for place in self.places)

    @cached_property
    def strangers(self) -> Sequence[tuple[Stranger, int]]:
        """Datagrams that are no telegrams, each once, as ``flows``."""
        found = self.traffic.strangers.items()
        return [(one, times) for one, times in found if self.places[one.place].sees_all or not self.sees_all]

    @cached_property
    def foreign(self) -> Sequence[tuple[Flow, int]]:
        """Telegrams that others sent, or that go from here to here."""
        return [(flow, times) for flow, times in self.flows if not self._is_sent_away(flow)]

    def _is_sent_away(self, flow: Flow) -> bool:
        return flow.is_own or (self._has_our_address(flow) and not self.is_twin(flow))

    def _has_our_address(self, flow: Flow) -> bool:
        place = self.interface_of(flow)
        return place is not None and not place.is_loopback and ipv4(flow.source) in self._own

    def is_twin(self, flow: Flow) -> bool:
        """Return whether telegrams under an address of this machine came from another device."""
        ours = self.machine.hardware if self.machine else frozenset()
        is_from_others = not flow.is_own and bool(flow.hardware and ours) and flow.hardware not in ours
        return is_from_others and self._has_our_address(flow)

    @cached_property
    def _own(self) -> frozenset[IPv4Address]:
        return self.machine.own if self.machine else frozenset()

    @cached_property
    def heard(self) -> Sequence[tuple[Flow, int]]:
        """What was looked for: telegrams of lists on a port where they are expected, with the right identity."""
        return [
            (flow, times) for flow, times in self.foreign
            if flow.is_list and not flow.is_ascii and flow.port in self.expected.ports
        ]  # fmt: skip

    @cached_property
    def reached(self) -> int:
        """How many telegrams plain sockets got, which is what programs of this machine get."""
        return sum(times for flow, times in self.traffic.flows.items() if not self.places[flow.place].sees_all)

    @property
    def keeps_from_programs(self) -> State:
        """How bad it is what keeps telegrams from programs: a capture sees them all the same."""
        is_seen = bool(self.reached) if self.asks_sockets else self.sees_all or bool(self.heard)
        return State.NOTE if is_seen else State.PROBLEM

    @property
    def frames(self) -> int:
        """All frames that were seen where all is seen; of plain sockets, datagrams."""
        return sum(
            times for number, times in self.traffic.frames.items()
            if self.places[number].sees_all or not self.sees_all
        )  # fmt: skip

    @property
    def ports(self) -> Sequence[int]:
        return self.expected.ports

    def interface_of(self, flow: Flow) -> Interface | None:
        """Return the interface by which telegrams came, None where that is unknown."""
        return self.machine.interface(self.places[flow.place].name) if self.machine else None

    def is_elsewhere(self, flow: Flow) -> bool:
        """Return whether telegrams came by an interface in none of whose networks their sender is."""
        interface, source = self.interface_of(flow), ipv4(flow.source)
        if interface is None or source is None or interface.is_loopback or source.is_unspecified:
            return False
        return bool(interface.addresses) and not any(source in own.network for own in interface.addresses)

    @cached_property
    def interfaces(self) -> Sequence[Interface]:
        """The interfaces that were asked about, else all through which others can be reached."""
        if self.machine is None:
            return ()
        named = [one for name in self.asked_interfaces if (one := self.machine.interface(name)) is not None]
        return named or self.machine.outward

    def senders(self, flows: Sequence[tuple[Flow, int]]) -> list[str]:
        """Return who sent telegrams, by address."""
        return sorted({flow.source for flow, _ in flows}, key=_order)

    def is_for_one(self, target: IPv4Address) -> bool:
        """Return whether an address is one station's, as far as this machine's netmasks tell."""
        return not (
            target == EVERYBODY or target.is_multicast or str(target).endswith(".255") or self.is_subnet(target)
        )

    def is_subnet(self, target: IPv4Address) -> bool:
        """Return whether an address is the broadcast address of a network that this machine is in."""
        return any(own.network.broadcast_address == target for own in self._addresses())

    def _addresses(self) -> Iterator[IPv4Interface]:
        for entry in self.machine.interfaces or () if self.machine else ():
            yield from entry.addresses


def ipv4(text: str) -> IPv4Address | None:
    """Return an IPv4 address, None for another one."""
    try:
        return IPv4Address(text)
    except AddressValueError:
        return None


def _order(text: str) -> tuple[int, int, str]:
    known = ipv4(text)
    return (0, int(known), "") if known else (1, 0, text)
