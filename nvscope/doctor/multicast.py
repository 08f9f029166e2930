"""Multicast: are the groups joined that lists are sent to?"""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.doctor.case import Case, ipv4
from nvscope.doctor.result import Result, State
from nvscope.enumeration import first_few

NAME = "multicast"


def judge_multicast(case: Case) -> Iterator[Result]:
    """Judge each group of the definitions and sources, and each that telegrams were seen to be sent to."""
    seen = {flow.target for flow, _ in case.foreign if (target := ipv4(flow.target)) and target.is_multicast}
    groups = sorted(seen | set(case.expected.groups))
    if not groups:
        yield Result(NAME, State.OK, "no list is sent to a multicast group")
        return
    joined = case.machine.groups if case.machine else None
    if joined is None:
        yield Result(NAME, State.UNKNOWN, f"whether {first_few(groups)} is joined is not known here")
        return
    for group in groups:
        where = sorted({one.interface for one in joined if one.group == group})
        if where:
            yield Result(NAME, State.OK, f"{group} is joined on {first_few(where)}", about=group)
            continue
        told = next((f"{one.told} goes to" for one in case.expected.targets if str(one.address) == group), "")
        yield Result(
            NAME, State.NOTE if group in seen else State.PROBLEM,
            f"{told + ' ' if told else ''}multicast group {group}, which no program of this machine has joined",
            f"watch udp://0.0.0.0:{case.ports[0]},{group}: it is joined as long; without a member, a switch with "
            "IGMP snooping keeps it away from this port", group, f"nobody here has joined {group}",
        )  # fmt: skip
