"""Telegrams: what came, on which ports, and in which form."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from dissectors.netvar import IDENTITY
from nvscope.doctor.case import Case
from nvscope.doctor.facts.traffic import Flow, Stranger
from nvscope.doctor.result import Result, State
from nvscope.enumeration import first_few
from nvscope.units import count_of, duration

TELEGRAMS, OTHER_PORTS, IDENTITY_CHECK, LISTS = "telegrams", "other-ports", "identity", "lists"
_NEAR = {
    b"3S-0": "the name of the protocol as people read it",
    b"3S-\0": "the identity with its bytes in reverse order",
    b"S3-\0": "the identity with two bytes exchanged",
    b"0S-3": "the identity with two bytes exchanged",
    b"-S3\0": "the identity without its first byte",
}
_RIGHT = IDENTITY.to_bytes(4, "little").hex(" ")


def judge_telegrams(case: Case) -> Iterator[Result]:
    """Judge whether there was anything of what was looked for; else, what there was in its place."""
    heard, ports = case.heard, case.expected.told_ports
    if heard:
        yield Result(TELEGRAMS, State.OK, told_of(case, heard))
        return
    while_told = f" in {duration(case.listened_ns)}" if case.listened_ns else ""
    own = sum(times for flow, times in case.flows if flow.is_list) - sum(t for f, t in case.foreign if f.is_list)
    if own:
        seen, step = f"only what this machine sends itself: {count_of(own, 'telegram')}", "see whether the others run"
    elif not any(case.traffic.frames.values()) and not case.sees_all and not case.places_open:
        seen, step = "nothing could be listened to", "see what stands above"
    elif case.frames and case.sees_all:
        seen = f"not one telegram on {ports}{while_told}, among {count_of(case.frames, 'frame')} of others"
        step = (
            "the cable works. See whether the controllers run, whether their lists are sent (cyclic, or on change), "
            "and to which address; what is for one station is only seen at a mirror port of the switch"
        )
    elif case.sees_all:
        seen = f"not one frame{while_told}"
        step = "see whether the controllers run, then the cable, the port of the switch and its VLAN"
    else:
        seen = f"not one telegram on {ports}{while_told}"
        step = "see whether the controllers run, and what of the above keeps it away; a capture sees more than a socket"
    if case.machine is None:
        step = "capture at a mirror port, without a filter, while the controllers run"
    yield Result(TELEGRAMS, State.PROBLEM, seen, step)


def told_of(case: Case, flows: Sequence[tuple[Flow, int]]) -> str:
    """Return what telegrams there are, in a sentence without its end."""
    lists = sorted({(flow.port, flow.list_id) for flow, _ in flows})
    senders = [case.expected.name_of(one) for one in case.senders(flows)]
    times = sum(times for _, times in flows)
    ports = sorted({flow.port for flow, _ in flows})
    places = sorted({case.places[flow.place].name for flow, _ in flows})
    where = f", by {first_few(places)}" if case.machine else ""
    told = f"{count_of(times, 'telegram')} of {count_of(len(lists), 'list')} on UDP {first_few(list(map(str, ports)))}"
    return f"{told} from {first_few(senders)}{where}"


def judge_other_ports(case: Case) -> Iterator[Result]:
    """Judge telegrams on ports where nobody expects them; on some port of the sender they all are."""
    if case.machine is not None and not case.sees_all:
        yield Result(
            OTHER_PORTS, State.UNKNOWN, "telegrams on other ports can only be seen by a capture",
            "capture on an interface that is up (-i NAME)" if case.machine.may_capture
            else "run it with sudo, or capture on the interface (-i NAME)",
        )  # fmt: skip
        return
    # Answers go to whatever port somebody has sent from.
    other = [
        (flow, times) for flow, times in case.foreign
        if flow.is_list and not flow.is_answer and flow.port not in case.ports
    ]  # fmt: skip
    if not other:
        yield Result(OTHER_PORTS, State.OK, "no telegram on another port")
        return
    ports = sorted({flow.port for flow, _ in other})
    told, first = first_few(list(map(str, ports))), ports[0]
    yield Result(
        OTHER_PORTS, State.NOTE if case.heard else State.PROBLEM,
        f"{told_of(case, other)}; expected on {case.expected.told_ports}",
        f"write `ports = [{', '.join(map(str, sorted({*case.ports, *ports})))}]` into nvscope.toml, or ask "
        f"udp://0.0.0.0:{first}; or correct the port in the sender's list properties", told,
        f"telegrams come on UDP {told}",
    )  # fmt: skip


def judge_identity(case: Case) -> Iterator[Result]:
    """Judge datagrams that are almost telegrams, and others on a port that should be theirs."""
    ascii_ones = [(flow, times) for flow, times in case.foreign if flow.is_ascii]
    almost: Counter[Stranger] = Counter()
    others: Counter[Stranger] = Counter()
    for stranger, times in case.strangers:
        near = stranger.is_like_one or stranger.begin in _NEAR
        (almost if near else others)[stranger] += times
    state = State.NOTE if case.heard else State.PROBLEM
    if ascii_ones:
        times = sum(times for _, times in ascii_ones)
        yield Result(
            IDENTITY_CHECK, state,
            f"{count_of(times, 'telegram')} of {first_few(case.senders(ascii_ones))} begin with the letter 0 (30 2d "
            f"53 33) in place of a byte 0 ({_RIGHT})",
            "correct the sender: controllers take no such telegram; nvscope reads it, and says so (NV106)",
            brief="the telegrams begin with a letter 0, which controllers do not take",
        )  # fmt: skip
    for begin in sorted({one.begin for one in almost}):
        mine = {one: times for one, times in almost.items() if one.begin == begin}
        what = f", {_NEAR[begin]}" if begin in _NEAR else ""
        yield Result(
            IDENTITY_CHECK, state,
            f"{count_of(sum(mine.values()), 'datagram')} of {first_few(sorted({one.source for one in mine}))} to UDP "
            f"{first_few(sorted({str(one.port) for one in mine}))} look like telegrams, and begin with {begin.hex(' ')}"
            f"{what}; a telegram begins with {_RIGHT}",
            "correct the sender, or, if another device means it so, read it by its port: "
            f"`-d udp.port=={min(one.port for one in mine)},nvl`",
            brief=f"what comes begins with {begin.hex(' ')}, and not with {_RIGHT}",
        )  # fmt: skip
    if others:
        begins = sorted({one.begin.hex(" ") for one in others})
        yield Result(
            IDENTITY_CHECK, state,
            f"{count_of(sum(others.values()), 'datagram')} to UDP "
            f"{first_few(sorted({str(one.port) for one in others}))} of "
            f"{first_few(sorted({one.source for one in others}))} are no telegrams: they begin with "
            f"{first_few(begins)}",
            "another protocol has this port: find out which program sends it, or take another port for the lists",
            brief="other datagrams have this port",
        )  # fmt: skip
    if not (ascii_ones or almost or others):
        yield Result(IDENTITY_CHECK, State.OK, "nothing that is almost a telegram")


def judge_lists(case: Case) -> Iterator[Result]:
    """Judge what came by the definitions: lists that they do not know, and those of theirs that did not come."""
    defined = case.expected.lists
    if not defined:
        yield Result(LISTS, State.OK, "no list is defined: all that come are welcome")
        return
    seen = {(flow.port, flow.list_id) for flow, _ in case.foreign if flow.is_list}
    known = {(key.port, key.identifier): name for key, name in defined.items()}
    came, missing = seen & set(known), [name for key, name in known.items() if key not in seen]
    unknown = [f"{index} on UDP {port}" for port, index in sorted(seen - set(known))]
    if seen and not came:
        yield Result(
            LISTS, State.PROBLEM,
            f"not one of the defined lists came ({first_few(missing)}); what comes is list {first_few(unknown)}",
            "compare identifier and port in the list's properties with the definitions that were named; perhaps these "
            "are of another project", brief="the lists that come are not the defined ones",
        )  # fmt: skip
    elif not seen:
        yield Result(LISTS, State.OK, f"{count_of(len(known), 'list')} defined, nothing to compare them with")
    elif missing or unknown:
        parts = [f"{first_few(missing)} did not come"] if missing else []
        parts += [f"nobody defined list {first_few(unknown)}"] if unknown else []
        yield Result(
            LISTS, State.NOTE, f"{count_of(len(came), 'defined list')} came; {'; '.join(parts)}",
            "a list that is sent on change or event rests meanwhile; listen longer with --for 60s" if missing
            else "name its definition, too",
        )  # fmt: skip
    else:
        yield Result(LISTS, State.OK, f"all {count_of(len(known), 'defined list')} came")
