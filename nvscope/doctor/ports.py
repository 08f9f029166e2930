"""Ports: who has them, and do they share?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nvscope.doctor.case import Case
from nvscope.doctor.facts.sockets import BoundPort
from nvscope.doctor.result import Result, State
from nvscope.enumeration import first_few

NAME = "ports"


def judge_ports(case: Case) -> Iterator[Result]:
    """Judge each port where telegrams are expected; who shares takes nothing from others but what is for one."""
    bound = case.machine.bound if case.machine else None
    if bound is None:
        yield Result(NAME, State.UNKNOWN, "who has UDP ports is not known on this system")
        return
    free = []
    for port in case.ports:
        holders = [entry for entry in bound if entry.port == port]
        if holders:
            yield _held(case, port, holders)
        else:
            free.append(str(port))
    if free:
        yield Result(NAME, State.OK, f"UDP {first_few(free)}: nobody has {'it' if len(free) == 1 else 'them'}")


def _held(case: Case, port: int, holders: Sequence[BoundPort]) -> Result:
    told = first_few(list(dict.fromkeys(one.told for one in holders)))
    hint = "" if all(one.process for one in holders) else f"; `sudo ss -ulpn sport = :{port}` tells which program it is"
    for_all = any(one.is_for_all for one in holders)
    shared = next((one.is_shared for one in holders if one.is_for_all), None)
    if shared is False:
        return Result(
            NAME, case.keeps_from_programs,
            f"UDP {port} is bound by {told}, which does not share it: no other program gets it",
            f"end that program, or capture on the interface, which shares with all: -i NAME{hint}", str(port),
            f"{told} has UDP {port} for itself",
        )  # fmt: skip
    where = "" if for_all else f" at {first_few(sorted({one.address for one in holders}))}"
    shares = ", and shared" if shared else ""
    return Result(
        NAME, State.NOTE, f"UDP {port} is bound by {told}{where}{shares}",
        "broadcasts come to all programs that have it; what is sent to this machine alone comes to one of them only: "
        f"capture on the interface to see it (-i NAME){hint}", str(port),
    )  # fmt: skip
