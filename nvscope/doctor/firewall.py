"""Firewall: does what comes in reach programs?"""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.doctor.case import Case, ipv4
from nvscope.doctor.expected import EVERYBODY
from nvscope.doctor.facts.firewall_rules import Fate
from nvscope.doctor.facts.traffic import Flow
from nvscope.doctor.result import Result, State
from nvscope.enumeration import first_few
from nvscope.units import count_of

NAME = "firewall"
_ENOUGH = 3
_SEES = "a capture on the interface sees it all the same: it is asked first"


def judge_firewall(case: Case) -> Iterator[Result]:
    """Judge the rules as far as they may be read, and whether a plain socket got what a capture saw."""
    if case.machine is None:
        return
    lost = sum(times for flow, times in case.foreign if _should_reach_a_socket(case, flow))
    got = case.reached
    is_lost = lost >= _ENOUGH and not got
    what = case.machine.firewall
    state = case.keeps_from_programs
    dropped = sorted({port for _, port, fate in what.fates if fate is Fate.DROPPED})
    depends = sorted({port for _, port, fate in what.fates if fate is Fate.DEPENDS} - set(dropped))
    if dropped:
        proof = f"; {count_of(lost, 'telegram')} came in, and no program got one" if is_lost else ""
        yield Result(
            NAME, state, f"the firewall drops UDP {first_few(list(map(str, dropped)))} ({what.read_with}){proof}",
            f"let it in, such as with `ufw allow {dropped[0]}/udp`, or by `udp dport {dropped[0]} accept` in front of "
            f"the rule that drops it: `sudo nft list ruleset` shows its table and chain; {_SEES}",
            brief=f"the firewall drops UDP {dropped[0]}",
        )  # fmt: skip
    elif is_lost:
        yield Result(
            NAME, state, f"{count_of(lost, 'telegram')} for this machine came in, and no program got one",
            "a firewall or the reverse-path filter drops them: see `sudo nft list ruleset` and "
            f"`sysctl net.ipv4.conf.all.rp_filter`; {_SEES}",
            brief="what comes in does not reach programs",
        )  # fmt: skip
    elif got:
        yield Result(NAME, State.OK, "telegrams reach programs of this machine")
    elif depends:
        yield Result(
            NAME, State.UNKNOWN,
            f"what the firewall does with UDP {first_few(list(map(str, depends)))} hangs on the sender, or on rules "
            f"that are not understood here ({what.read_with})", f"look at them: `sudo nft list ruleset`; {_SEES}",
        )  # fmt: skip
    elif what.fates:
        yield Result(
            NAME, State.OK, f"the firewall lets UDP {first_few(list(map(str, case.ports)))} in ({what.read_with})"
        )
    elif case.machine.may_capture is None:
        yield Result(NAME, State.UNKNOWN, "what the firewall does is not known on this system")
    else:
        clues = f": {'; '.join(what.clues)}" if what.clues else ""
        yield Result(
            NAME, State.UNKNOWN, f"the rules of the firewall can only be read as root, with nft or iptables{clues}",
            f"`sudo nvscope doctor` reads them; {_SEES}",
        )  # fmt: skip


def _should_reach_a_socket(case: Case, flow: Flow) -> bool:
    """Return whether telegrams were for programs of this machine, and a socket was open for them."""
    interface, target = case.interface_of(flow), ipv4(flow.target)
    opened = {place.name for place in case.places if not place.sees_all and not place.failure}
    if interface is None or target is None or interface.is_loopback or flow.vlan > 0:
        return False
    if f"udp://0.0.0.0:{flow.port}" not in opened or not interface.addresses:
        return False
    own = {one.ip for one in interface.addresses} | {one.network.broadcast_address for one in interface.addresses}
    return target == EVERYBODY or target in own
