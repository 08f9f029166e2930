"""What a firewall does with a telegram, told from its rules; what arrives is the oracle."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import closing
from shutil import which
from typing import Any

import pytest

from nvscope.doctor.facts.firewall_rules import Fate, Packet, fate_of
from nvscope.doctor.facts.iptables_rules import chains_of_iptables
from nvscope.doctor.facts.nft_rules import chains_of_nft
from tests.capture.live.network import Host, cable, needs_namespaces

_LISTEN = """
import socket, sys
held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
held.bind(("0.0.0.0", 1202)); held.settimeout(0.1); print("held", flush=True)
for _ in sys.stdin:
    try:
        print(held.recv(100).decode(), flush=True)
    except TimeoutError:
        print("nothing", flush=True)
"""
_SEND = """
import socket, sys
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for _ in sys.stdin:
    out.sendto(b"something", (sys.argv[1], 1202))
    print("sent", flush=True)
"""

_HEAD = "type filter hook input priority 0; policy {policy}"
NFT = {
    "nothing": ("accept", "counter", Fate.ACCEPTED),
    "policy": ("drop", 'iifname "lo" accept\nct state established,related accept\ntcp dport 1202 accept', Fate.DROPPED),
    "let in": ("drop", "udp dport 1202 accept", Fate.ACCEPTED),
    "range": ("drop", "udp dport 1000-1300 accept", Fate.ACCEPTED),
    "set": ("drop", "udp dport { 53, 1202 } accept", Fate.ACCEPTED),
    "another": ("drop", "udp dport 1203 accept", Fate.DROPPED),
    "but that": ("accept", "udp dport != 53 drop", Fate.DROPPED),
    "reject": ("accept", "meta l4proto udp reject", Fate.DROPPED),
    "map": ("drop", "ct state vmap { established : accept, invalid : drop, new : accept }", Fate.ACCEPTED),
    "first counts": ("accept", "udp dport 1202 counter accept\nudp dport 1202 drop", Fate.ACCEPTED),
    "chain": ("accept", "jump further", Fate.DROPPED),
    "by address": ("drop", "ip saddr 10.77.0.0/24 accept", Fate.DEPENDS),
    "limit": ("accept", "udp dport 1202 limit rate over 1/hour drop", Fate.DEPENDS),
    "another interface": ("drop", 'iifname "eth7" udp dport 1202 accept', Fate.DROPPED),
}
IPTABLES = {
    "nothing": ("ACCEPT", [], Fate.ACCEPTED),
    "policy": ("DROP", ["-i lo -j ACCEPT", "-m conntrack --ctstate RELATED,ESTABLISHED -j ACCEPT"], Fate.DROPPED),
    "let in": ("DROP", ["-p udp -m udp --dport 1202 -j ACCEPT"], Fate.ACCEPTED),
    "several": ("DROP", ["-p udp -m multiport --dports 53,1200:1210 -j ACCEPT"], Fate.ACCEPTED),
    "another": ("DROP", ["-p tcp -m tcp --dport 1202 -j ACCEPT"], Fate.DROPPED),
    "but that": ("ACCEPT", ["-p udp -m udp ! --dport 53 -j REJECT --reject-with icmp-port-unreachable"], Fate.DROPPED),
    "comment": ("ACCEPT", ['-p udp -m udp --dport 1202 -m comment --comment "not this -j" -j DROP'], Fate.DROPPED),
    "by address": ("DROP", ["-s 10.77.0.0/24 -p udp -j ACCEPT"], Fate.DEPENDS),
    "chain": ("ACCEPT", ["-j FURTHER"], Fate.DROPPED),
}


@needs_namespaces
@pytest.mark.skipif(which("nft") is None, reason="needs nft (nftables)")
def test_rules_of_nft_do_what_is_told_of_them() -> None:
    with cable() as (sender, reader), closing(_Probe(sender, reader)) as probe:
        for name, (policy, rules, fate) in NFT.items():
            further = "chain further { udp dport 1202 drop\n }"
            chain = f"chain input {{ {_HEAD.format(policy=policy)}\n{rules}\n }}"
            _nft(reader, "flush ruleset\n" + f"table inet filter {{\n{further}\n{chain}\n}}\n")
            listed = _on(reader, "nft", "-j", "list", "ruleset")
            told = fate_of(chains_of_nft(json.loads(listed)), Packet(reader.device, 1202))
            assert told is fate, name
            assert fate is Fate.DEPENDS or probe.arrives() == (fate is Fate.ACCEPTED), name


@needs_namespaces
@pytest.mark.skipif(which("iptables-save") is None, reason="needs iptables")
def test_rules_of_iptables_do_what_is_told_of_them() -> None:
    with cable() as (sender, reader), closing(_Probe(sender, reader)) as probe:
        _on(reader, "iptables", "-N", "FURTHER")
        _on(reader, "iptables", "-A", "FURTHER", "-p", "udp", "--dport", "1202", "-j", "DROP")
        for name, (policy, rules, fate) in IPTABLES.items():
            _on(reader, "iptables", "-F", "INPUT")
            _on(reader, "iptables", "-P", "INPUT", policy)
            for rule in rules:
                _on(reader, "sh", "-c", f"iptables -A INPUT {rule}")
            told = fate_of(chains_of_iptables(_on(reader, "iptables-save")), Packet(reader.device, 1202))
            assert told is fate, name
            assert fate is Fate.DEPENDS or probe.arrives() == (fate is Fate.ACCEPTED), name


def _nft(host: Host, rules: str) -> None:
    words = ["ip", "netns", "exec", host.namespace, "nft", "-f", "-"]
    subprocess.run(words, input=rules, text=True, check=True, timeout=10)


def _on(host: Host, *words: str) -> str:
    done = subprocess.run(
        ["ip", "netns", "exec", host.namespace, *words], capture_output=True, text=True, check=True, timeout=10
    )
    return done.stdout


class _Probe:
    """Sends a datagram and looks whether it comes to a program, again and again."""

    def __init__(self, sender: Host, reader: Host) -> None:
        self._reader = _started(reader, _LISTEN)
        assert _line(self._reader) == "held"
        self._sender = _started(sender, _SEND, reader.address)

    def arrives(self) -> bool:
        for process, told in ((self._sender, "sent"), (self._reader, "")):
            assert process.stdin is not None
            process.stdin.write("now\n")
            process.stdin.flush()
            said = _line(process)
            assert told in said
        return said == "something"

    def close(self) -> None:
        for process in (self._sender, self._reader):
            process.communicate(timeout=10)


def _started(host: Host, *words: str) -> subprocess.Popen[str]:
    command = ["ip", "netns", "exec", host.namespace, sys.executable, "-S", "-c", *words]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


SAVED = """# Generated by iptables-save
*nat
:PREROUTING DROP [0:0]
COMMIT
*filter
:INPUT DROP [0:0]
:ufw-user - [0:0]
[12:1200] -A INPUT -m recent --update --seconds 60 --rsource -j ACCEPT
-A INPUT -g ufw-user
-A ufw-user -p udp -m udp --dport 1300 -j ACCEPT
-A ufw-user -p udp -m udp --dport 1400 -j RETURN
COMMIT
"""


@pytest.mark.parametrize(("port", "fate"), [(1300, Fate.ACCEPTED), (1202, Fate.DEPENDS), (1400, Fate.DEPENDS)])
def test_rules_are_read_as_they_are_saved(port: int, fate: Fate) -> None:
    """What is not understood (here: who came lately) may hold or not; a chain that is gone to does not come back."""
    assert fate_of(chains_of_iptables(SAVED), Packet("eth0", port)) is fate


@pytest.mark.parametrize(
    "expression", [{"newer": 1}, {"match": {"op": "<", "left": {"meta": {"key": "x"}}, "right": 1}}]
)
def test_what_is_not_understood_is_not_guessed(expression: dict[str, Any]) -> None:
    head = {"family": "inet", "table": "filter"}
    chain = {**head, "name": "input", "type": "filter", "hook": "input", "policy": "accept"}
    rule = {**head, "chain": "input", "expr": [expression, {"drop": None}]}
    chains = chains_of_nft({"nftables": [{"metainfo": {}}, {"chain": chain}, {"rule": rule}]})
    assert fate_of(chains, Packet("eth0", 1202)) is Fate.DEPENDS


def test_chains_that_call_each_other_without_end_are_left() -> None:
    saved = "*filter\n:INPUT DROP [0:0]\n:A - [0:0]\n-A INPUT -j A\n-A A -j A\nCOMMIT\n"
    assert fate_of(chains_of_iptables(saved), Packet("eth0", 1202)) is Fate.DEPENDS
