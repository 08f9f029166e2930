"""The rules of nftables as ``nft -j list ruleset`` writes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from nvscope.doctor.facts.firewall_rules import Chain, Chains, Packet, Rule, RuleText, Ways

_FAMILIES = ("ip", "inet")
_HOOKS = ("input", "prerouting")
_VERDICTS = {
    "accept": Ways.ACCEPT, "drop": Ways.DROP, "reject": Ways.DROP, "return": Ways.RETURN, "continue": Ways.ON,
}  # fmt: skip
_NO_CONDITIONS = ("counter", "log", "comment", "notrack", "mangle", "ct count", "meter", "set", "add")
_UDP = ("udp", 17)


def chains_of_nft(document: Mapping[str, Any]) -> Chains:
    """Return the chains that packets to this machine pass, and those that may be called from them."""
    entries = document["nftables"]
    rules: dict[str, list[RuleText]] = {}
    heads: dict[str, Ways | None] = {}
    for entry in entries:
        if head := entry.get("chain"):
            if head["family"] in _FAMILIES:
                asked = head.get("hook") in _HOOKS and head.get("type") == "filter"
                policy = _VERDICTS.get(head.get("policy", "accept"), Ways.ACCEPT) if asked else None
                heads[_name(head, head["name"])] = policy
        elif (rule := entry.get("rule")) and rule["family"] in _FAMILIES:
            rules.setdefault(_name(rule, rule["chain"]), []).append(_NftRule(rule.get("expr", []), _name(rule, "")))
    return {name: Chain(rules.get(name, []), policy) for name, policy in heads.items()}


def _name(entry: Mapping[str, Any], chain: str) -> str:
    return f"{entry['family']} {entry['table']} {chain}"


class _NftRule(Struct, RuleText, frozen=True):
    expressions: list[Any]
    table: str

    def of(self, packet: Packet) -> Rule:
        holds: bool | None = True
        for one in self.expressions:
            entries: list[tuple[str, Any]] = list(one.items()) if isinstance(one, dict) and one else [(str(one), None)]
            kind, value = entries[0]
            if kind == "match":
                told = _matches(value, packet)
                if told is False:
                    return Rule(False, Ways.ON)
                holds = holds if told else None
            elif kind in ("jump", "goto"):
                return Rule(holds, Ways.NONE, (self.table + value["target"],), is_goto=kind == "goto")
            elif kind == "vmap":
                return self._mapped(value, packet, holds)
            elif kind in _VERDICTS:
                return Rule(holds, _VERDICTS[kind])
            elif kind not in _NO_CONDITIONS:
                holds = None  # a limit, a set that is looked up, or something newer than this
        return Rule(holds, Ways.ON)

    def _mapped(self, value: Mapping[str, Any], packet: Packet, holds: bool | None) -> Rule:
        """Return what a map of verdicts says, all of it that may hold."""
        data = value["data"]
        if not isinstance(data, dict) or "set" not in data:
            return Rule(None, Ways.ACCEPT | Ways.DROP | Ways.ON)
        ways, calls, surely = Ways.NONE, [], False
        for keys, verdict in data["set"]:
            told = _compared(value["key"], keys, packet)
            if told is False:
                continue
            surely |= bool(told)
            (kind, argument), *_ = verdict.items()
            if kind in ("jump", "goto"):
                calls.append(self.table + argument["target"])
            else:
                ways |= _VERDICTS.get(kind, Ways.ACCEPT | Ways.DROP)
            if told:
                break
        return Rule(holds, ways if surely else ways | Ways.ON, tuple(calls))


def _matches(value: Mapping[str, Any], packet: Packet) -> bool | None:
    told = _compared(value["left"], value["right"], packet)
    if told is None or value.get("op", "==") in ("==", "in"):
        return told
    return not told if value["op"] == "!=" else None


def _compared(left: Any, right: Any, packet: Packet) -> bool | None:
    """Return whether what ``left`` names is among ``right`` in a packet."""
    name, own = _asked(left, packet)
    if name == "state":  # of the first packet of somebody
        words = set(_items(right))
        return "new" in words if words <= {"new", "established", "related", "invalid", "untracked"} else None
    if name == "never":
        return False
    if own is None:
        return None
    held = [_holds(one, own) for one in _items(right)]
    return True if True in held else None if None in held else False


def _asked(left: Any, packet: Packet) -> tuple[str, tuple[Any, ...] | None]:
    """Return what is asked for, and what the packet has there; None where nobody knows."""
    if isinstance(left, dict) and (meta := left.get("meta")):
        key = meta.get("key")
        if key in ("iifname", "iif"):
            return "interface", (packet.interface,) if packet.interface else None
        if key == "l4proto":
            return "protocol", _UDP
        return ("family", ("ipv4", "ip", 2)) if key in ("nfproto", "protocol") else ("", None)
    if isinstance(left, dict) and (load := left.get("payload")):
        protocol, name = load.get("protocol"), load.get("field")
        if protocol in ("tcp", "icmp", "icmpv6", "sctp", "dccp", "ip6", "igmp"):
            return "never", None
        if protocol in ("udp", "th") and name == "dport":
            return "port", (packet.port,)
        return ("protocol", _UDP) if (protocol, name) == ("ip", "protocol") else ("", None)
    if isinstance(left, dict) and isinstance(state := left.get("ct"), dict) and state.get("key") == "state":
        return "state", None
    return "", None


def _items(right: Any) -> list[Any]:
    if isinstance(right, dict) and "set" in right:
        right = right["set"]
    return list(right) if isinstance(right, list) else [right]


def _holds(item: Any, own: tuple[Any, ...]) -> bool | None:
    if isinstance(item, dict) and "range" in item:
        low, high = item["range"]
        numbers = [one for one in own if isinstance(one, int)]
        return low <= numbers[0] <= high if numbers and isinstance(low, int) and isinstance(high, int) else None
    if isinstance(item, str) and item.startswith("@"):
        return None
    if isinstance(item, str) and item.endswith("*"):
        return any(str(one).startswith(item[:-1]) for one in own)
    return None if isinstance(item, dict) else item in own
