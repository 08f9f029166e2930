"""The rules of iptables as ``iptables-save`` writes them."""

from __future__ import annotations

import re
import shlex
from collections import deque

from msgspec import Struct

from nvscope.doctor.facts.firewall_rules import Chain, Chains, Packet, Rule, RuleText, Ways

_TABLES = {"filter": "INPUT", "raw": "PREROUTING", "mangle": "PREROUTING"}
_VERDICTS = {"ACCEPT": Ways.ACCEPT, "DROP": Ways.DROP, "REJECT": Ways.DROP, "RETURN": Ways.RETURN}
_GO_ON = ("LOG", "NFLOG", "MARK", "CONNMARK", "NOTRACK", "CT", "SET", "TRACE", "TOS", "DSCP", "")
_NO_CONDITIONS = ("--log-prefix", "--log-level", "--reject-with", "--comment", "--set-xmark")
_HARMLESS_MODULES = ("comment", "udp", "multiport", "conntrack", "state", "tcp", "icmp")
_ANY_COUNT = re.compile(r"^\[\d+:\d+\] ")


def chains_of_iptables(text: str) -> Chains:
    """Return the chains that packets to this machine pass, and those that may be called from them."""
    rules: dict[str, list[RuleText]] = {}
    policies: dict[str, Ways | None] = {}
    table = ""
    for line in text.splitlines():
        words = _ANY_COUNT.sub("", line)
        if words.startswith("*"):
            table = words[1:].strip()
        elif words.startswith(":") and table in _TABLES:
            name, policy, *_ = words[1:].split()
            policies[f"{table} {name}"] = _VERDICTS.get(policy) if name == _TABLES[table] else None
        elif words.partition(" ")[0] == "-A" and table in _TABLES:
            _, chain, *rest = shlex.split(words)
            rules.setdefault(f"{table} {chain}", []).append(_IptablesRule(tuple(rest), table))
    return {name: Chain(rules.get(name, []), policy) for name, policy in policies.items()}


class _IptablesRule(Struct, RuleText, frozen=True):
    words: tuple[str, ...]
    table: str

    def of(self, packet: Packet) -> Rule:
        holds: bool | None = True
        target, is_goto, inverted = "", False, False
        words = deque(self.words)
        while words:
            word = words.popleft()
            if word == "!":
                inverted = True
                continue
            if word in ("-j", "-g"):
                target, is_goto = words.popleft() if words else "", word == "-g"
                continue
            value = words.popleft() if words and not words[0].startswith("-") and words[0] != "!" else ""
            if word in _NO_CONDITIONS:
                continue
            told = self._condition(word, value, packet)
            if told is not None and inverted:
                told = not told
            inverted = False
            if told is False:
                return Rule(False, Ways.ON)
            holds = holds if told else None
        if target in _VERDICTS:
            return Rule(holds, _VERDICTS[target])
        if target in _GO_ON:
            return Rule(holds, Ways.ON)
        return Rule(holds, Ways.NONE, (f"{self.table} {target}",), is_goto)

    @staticmethod
    def _condition(word: str, value: str, packet: Packet) -> bool | None:
        if word == "-p":
            return value in ("udp", "17", "all")
        if word == "-i":
            own = packet.interface
            if not own:
                return None
            return own.startswith(value[:-1]) if value.endswith("+") else own == value
        if word in ("--dport", "--dports"):
            return any(_in_range(part, packet.port) for part in value.split(","))
        if word in ("--ctstate", "--state"):
            return "NEW" in value.split(",")
        return True if word == "-m" and value in _HARMLESS_MODULES else None


def _in_range(part: str, port: int) -> bool:
    low, sign, high = part.partition(":")
    if not sign:
        return part == str(port)
    return int(low or 0) <= port <= int(high or 65_535)
