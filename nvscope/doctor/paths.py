"""Paths: how telegrams came: with VLAN tags, by routers, to whom; and who sent them back, or never answered."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from nvscope.doctor.case import Case, ipv4
from nvscope.doctor.facts.traffic import Flow
from nvscope.doctor.result import Result, State
from nvscope.enumeration import first_few
from nvscope.units import count_of

VLAN, ROUTERS, UNREACHABLE, CONVERSATIONS, ARP = "vlan", "routers", "unreachable", "conversations", "arp"
_AT_BEGIN = (0, 1, 30, 32, 60, 64, 100, 128, 200, 255)
"""Times to live that operating systems begin with; 0 where nobody tells."""

_MOST_HOPS = 16
_ASKED_AGAIN = 3
_CODES = {
    0: "its network cannot be reached", 1: "the host cannot be reached", 2: "it knows no UDP",
    3: "no program has the port there", 9: "a firewall forbids it", 10: "a firewall forbids it",
    13: "a firewall forbids it",
}  # fmt: skip
_ENOUGH = 3


def judge_vlan(case: Case) -> Iterator[Result]:
    """Judge telegrams with VLAN tags: programs do not get them, unless an interface takes the tag away."""
    if _is_blind(case):
        yield Result(VLAN, State.UNKNOWN, "VLAN tags can only be seen by a capture")
        return
    here = {entry.vlan for entry in case.machine.interfaces or ()} if case.machine else set()
    tags: Counter[int] = Counter()
    for flow, times in case.foreign:
        if flow.vlan > 0 and flow.vlan not in here:  # number 0 is a priority, and no VLAN
            tags[flow.vlan] += times
    if not tags:
        yield Result(VLAN, State.OK, "no telegram has a VLAN tag that this machine does not take away")
        return
    plain = any(flow.vlan <= 0 for flow, _ in case.heard)
    told, first = first_few([str(tag) for tag in sorted(tags)]), min(tags)
    interface = next((case.places[flow.place].name for flow, _ in case.foreign if flow.vlan == first), "NAME")
    where = f"here: `ip link add link {interface} name vlan{first} type vlan id {first}`; or " if case.machine else ""
    yield Result(
        VLAN, State.NOTE if plain or case.machine is None else State.PROBLEM,
        f"{count_of(sum(tags.values()), 'telegram')} of {first_few(_tagged(case, tags))} have the VLAN tag {told}: "
        "programs without an interface of that VLAN do not get them",
        f"{where}let the switch take the tag away at this port (untagged, access). A capture sees them; "
        f"a capture filter needs `vlan {first} and …`", told,
        f"they have the VLAN tag {told}, and programs do not get them",
    )  # fmt: skip


def _tagged(case: Case, tags: Counter[int]) -> Sequence[str]:
    return case.senders([(flow, times) for flow, times in case.foreign if flow.vlan in tags])


def judge_routers(case: Case) -> Iterator[Result]:
    """Judge senders that are behind a router: what they broadcast does not come here."""
    routed: dict[str, str] = {}
    by_hardware: dict[str, set[str]] = {}
    for flow, _ in case.foreign:
        if flow.hardware and ipv4(flow.source):
            by_hardware.setdefault(flow.hardware, set()).add(flow.source)
        if (hops := _hops(flow.hops)) and flow.source not in routed:
            routed[flow.source] = f"{count_of(hops, 'router')} on the way"
    for sources in by_hardware.values():
        if len(sources) >= _ENOUGH:
            for source in sources:
                routed.setdefault(source, f"{len(sources)} senders have one hardware address, as behind a router")
    for source in _elsewhere(case):
        routed.setdefault(source, "its address is in no network of the interface")
    if not routed:
        yield Result(ROUTERS, State.OK, "no sender is behind a router")
    for source, why in list(routed.items())[:_MOST_HOPS]:
        yield Result(
            ROUTERS, State.NOTE, f"{case.expected.name_of(source)} is in another network: {why}",
            "only what it addresses to one station, or what a router passes on, comes here; its broadcasts do not: "
            "send its lists to the address of the reader, or capture in its network", source,
        )  # fmt: skip


def _hops(left: int) -> int:
    """Return how many routers took one off a time to live, 0 where nobody did."""
    if left in _AT_BEGIN:
        return 0
    begin = next((one for one in (32, 64, 128, 255) if one > left), left)
    return begin - left if begin - left <= _MOST_HOPS else 0


def _elsewhere(case: Case) -> Iterator[str]:
    """Yield senders of which the interface that they came by is not in the network.

    Routers let no broadcast pass: whoever is heard with one is no further away than the wire.
    """
    near = {flow.source for flow, _ in case.foreign if flow.to_all}
    for flow, _ in case.foreign:
        if flow.source not in near and case.is_elsewhere(flow):
            yield flow.source


def judge_unreachable(case: Case) -> Iterator[Result]:
    """Judge who sends telegrams back: nobody listens there, or a firewall is in between."""
    refused: dict[tuple[str, int, int], int] = {}
    for one, times in case.traffic.refusals.items():
        place = (one.target, one.port, one.code)
        refused[place] = refused.get(place, 0) + times
    for (target, port, code), times in sorted(refused.items()):
        why = _CODES.get(code, f"ICMP code {code}") if ipv4(target) else "it cannot be reached"
        yield Result(
            UNREACHABLE, State.PROBLEM,
            f"{count_of(times, 'telegram')} to {case.expected.name_of(target)}, UDP {port}, came back: {why}",
            "see whether the reader's program runs, on this port, and its firewall; NV305 in `nvscope report` tells of "
            "which lists", target, f"{target} takes nothing on UDP {port}",
        )  # fmt: skip
    if not refused:
        known = State.UNKNOWN if _is_blind(case) else State.OK
        told = "what others send back can only be seen by a capture" if _is_blind(case) else "nobody sends one back"
        yield Result(UNREACHABLE, known, told)


def judge_conversations(case: Case) -> Iterator[Result]:
    """Judge whether what goes from one station to another can be seen: at most ports of a switch it cannot."""
    if _is_blind(case):
        yield Result(CONVERSATIONS, State.UNKNOWN, "what others say to each other can only be seen by a capture")
        return
    seen = {flow.target for flow, _ in case.foreign if _is_between_others(case, flow)}
    targets = {flow.target for flow, _ in case.flows}
    unseen = [
        one for one in case.expected.targets
        if case.is_for_one(one.address) and str(one.address) not in targets and one.address not in _own(case)
    ]  # fmt: skip
    for one in unseen:
        yield Result(
            CONVERSATIONS, State.NOTE if case.heard else State.PROBLEM,
            f"{one.told} is sent to {case.expected.name_of(str(one.address))} alone, and nothing of that was seen",
            "a switch shows it to nobody else: set up a mirror port (port mirroring, SPAN) at the sender's port of the "
            "switch, or capture on one of the two", str(one.address), f"{one.told} is for {one.address} alone",
        )  # fmt: skip
    if unseen:
        return
    asked = any(flow.wants_answer for flow, _ in case.foreign)
    answered = any(flow.is_answer for flow, _ in case.flows)
    if asked and not answered and not seen:
        yield Result(
            CONVERSATIONS, State.NOTE, "telegrams ask for an acknowledgement, and not one answer was seen",
            "answers go from the reader to the sender, and a switch shows them to nobody else: at a mirror port they "
            "would be seen",
        )  # fmt: skip
    elif seen:
        yield Result(CONVERSATIONS, State.OK, "what others say to each other can be seen")
    else:
        yield Result(CONVERSATIONS, State.OK, "nothing that goes to one station alone is expected")


def judge_arp(case: Case) -> Iterator[Result]:
    """Judge addresses for which senders of telegrams, or nodes of the project, ask in vain."""
    known = {flow.source for flow, _ in case.foreign} | set(case.expected.nodes)
    wanted = {str(one.address) for one in case.expected.targets}
    # Who is there asks for others itself, or is seen with what it sends.
    there = case.traffic.answered | {flow.source for flow, _ in case.flows} | {str(own) for own in _own(case)}
    found = False
    for question, times in sorted(case.traffic.questions.items()):
        near = question.asker in known or question.wanted in wanted
        if times < _ASKED_AGAIN or not near or question.wanted in there:
            continue
        found = True
        yield Result(
            ARP, State.NOTE if case.heard else State.PROBLEM,
            f"{case.expected.name_of(question.asker)} asks {times} times for {case.expected.name_of(question.wanted)}, "
            "and nobody answers",
            "nothing is sent to an address that nobody has: see whether that node is on, and the address in the "
            "sender's list properties", question.wanted, f"nobody has the address {question.wanted}",
        )  # fmt: skip
    if not found:
        blind = _is_blind(case)
        told = "who asks for whom can only be seen by a capture" if blind else "no sender asks in vain for an address"
        yield Result(ARP, State.UNKNOWN if blind else State.OK, told)


def _is_between_others(case: Case, flow: Flow) -> bool:
    target = ipv4(flow.target)
    return not flow.to_all and target is not None and not target.is_multicast and target not in _own(case)


def _own(case: Case) -> frozenset[object]:
    return frozenset(case.machine.own) if case.machine else frozenset()


def _is_blind(case: Case) -> bool:
    return case.machine is not None and not case.sees_all
