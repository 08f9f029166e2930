"""Interfaces: is there one that is up, with a cable, by which something can come in?"""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.doctor.case import Case
from nvscope.doctor.facts.machine import Interface
from nvscope.doctor.result import Result, State
from nvscope.enumeration import first_few

NAME = "interfaces"


def judge_interfaces(case: Case) -> Iterator[Result]:
    """Judge those that were asked about, else all that lead to others; one that works is enough."""
    if case.machine is None or case.machine.interfaces is None:
        yield Result(NAME, State.UNKNOWN, "what interfaces this machine has is not known on this system")
        return
    found = case.interfaces
    usable = [one for one in found if one.is_usable]
    asked = bool(case.asked_interfaces)
    if not found:
        yield Result(
            NAME, State.PROBLEM, "this machine has no interface that leads to others",
            "connect a network card, or give the virtual machine or container one",
            brief="this machine has no interface that leads to others",
        )  # fmt: skip
    for one in found:
        if one.is_usable or (one.is_loopback and one.is_up):
            continue
        # On most machines something is down that nobody uses.
        if not asked and usable and (case.heard or not one.is_physical):
            continue
        yield _down(one, is_note=bool(usable) and not asked)
    bare = [one for one in usable if not one.addresses]
    if usable and len(bare) == len(usable):
        yield Result(
            NAME, State.NOTE, f"up, without an IPv4 address: {first_few([one.name for one in bare])}",
            f"a capture sees all (-i {bare[0].name}); programs and udp:// get no subnet broadcast without an address: "
            f"`ip addr add ADDRESS/BITS dev {bare[0].name}`",
        )  # fmt: skip
    elif usable:
        told = first_few([one.told for one in usable if one.addresses])
        yield Result(NAME, State.OK, f"up, with a carrier: {told}")
    elif found and all(one.is_loopback for one in found):
        yield Result(NAME, State.OK, f"up, and leading to this machine alone: {first_few([one.told for one in found])}")


def _down(one: Interface, *, is_note: bool) -> Result:
    state = State.NOTE if is_note else State.PROBLEM
    if not one.is_up:
        return Result(
            NAME, state, f"{one.name} is down", f"set it up: `ip link set {one.name} up`", one.name,
            f"{one.name} is down",
        )  # fmt: skip
    return Result(
        NAME, state, f"{one.name} is up, and has no carrier: no cable, or nothing works at its other end",
        "look at the cable, the LEDs of the port, and the switch; a port of a switch may be switched off", one.name,
        f"{one.name} has no carrier",
    )  # fmt: skip
