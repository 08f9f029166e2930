"""What keeps telegrams from programs of this machine: ports, permissions, groups, the firewall."""

from __future__ import annotations

import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from shutil import which

import pytest

from tests.capture.live.network import Host, needs_namespaces, send
from tests.doctor.hosts import (
    NOBODY,
    asked,
    definition,
    holding,
    needs_nobody,
    of_state,
    routed,
    running,
    seen,
    sending,
)

pytestmark = needs_namespaces


def test_nothing_is_sent(pair: tuple[Host, Host]) -> None:
    _, reader = pair
    before = _sent(reader)
    asked(reader, f"udp://0.0.0.0:1202,{'239.1.2.3'}")
    assert _sent(reader) == before


def _sent(host: Host) -> int:
    path = f"/sys/class/net/{host.device}/statistics/tx_packets"
    done = subprocess.run(
        ["ip", "netns", "exec", host.namespace, "cat", path], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


@pytest.mark.parametrize("how", ["alone", "shared"])
def test_a_port_is_bound_by_another_program(how: str, pair: tuple[Host, Host]) -> None:
    _, reader = pair
    with holding(reader, "1202", how):
        found = asked(reader)
        # A capture shares with all; a plain socket does not.
        assert "ports" in of_state(found, "note")
        plain = asked(reader, "udp://0.0.0.0:1202")
        assert ("ports" in of_state(plain, "problem")) == (how == "alone")
        assert "python" in seen(found, "ports")
        assert "(PID " in seen(found, "ports")


@needs_nobody
def test_a_port_is_bound_by_the_program_of_another_user(pair: tuple[Host, Host]) -> None:
    _, reader = pair
    with holding(reader, "1202", "alone"):
        found = asked(reader, user=NOBODY)
    assert of_state(found, "problem") == ["ports", "permissions", "telegrams"]
    assert found["listened_ns"] is None
    assert "nothing could be listened to" in seen(found, "telegrams")
    # Of others' programs, only whose they are can be seen.
    assert "a process of user root" in seen(found, "ports")


_COUNT = """
import socket, struct
held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
held.bind(("", 1202))
held.settimeout(10)
print("held", flush=True)
seen = []
while not seen or seen[-1] < 299:
    seen.append(struct.unpack("<I", held.recv(100)[20:])[0])
print(len(seen), flush=True)
"""


def test_who_has_the_port_loses_nothing_while_it_is_asked(pair: tuple[Host, Host]) -> None:
    """What is sent to one station comes to one program only, even where the port is shared."""
    sender, reader = pair
    with running(reader.start(sys.executable, "-c", _COUNT), "held") as holder:
        sent = sender.start(*send(reader.address, 300, 1, 5_000_000))
        asked(reader)
        assert holder.stdout is not None
        assert holder.stdout.readline() == "300\n"
        sent.communicate(timeout=10)


@needs_nobody
def test_a_user_who_may_not_capture(pair: tuple[Host, Host]) -> None:
    sender, reader = pair
    silent = asked(reader, user=NOBODY)
    with sending(sender):
        heard = asked(reader, user=NOBODY)
    assert of_state(silent, "problem") == ["permissions", "telegrams"]
    assert {"other-ports", "vlan", "conversations", "firewall"} <= set(of_state(silent, "unknown"))
    assert of_state(heard, "problem") == []
    assert heard["telegrams"] > 0


def test_a_multicast_group_is_not_joined(tmp_path: Path, pair: tuple[Host, Host]) -> None:
    group = "239.10.10.11"
    path = definition(tmp_path, group)
    sender, reader = pair
    silent = asked(reader, path)
    sender.ip("route", "replace", "224.0.0.0/4", "dev", sender.device)
    with sending(sender, group):
        heard = asked(reader, path)
        with holding(reader, "1300", "shared", group, reader.address):
            joined = asked(reader, path)
    assert of_state(silent, "problem") == ["multicast", "telegrams"]
    assert "multicast" in of_state(heard, "note")
    assert "multicast" in of_state(joined, "ok")


@pytest.mark.skipif(which("nft") is None, reason="needs nft (nftables)")
def test_the_firewall_drops_what_comes(pair: tuple[Host, Host]) -> None:
    rules = (
        "table inet filter { chain input { type filter hook input priority 0; policy drop; "
        'iifname "lo" accept; ct state established,related accept; tcp dport 22 accept; PLACE;\n}\n}\n'
    )
    sender, reader = pair
    words = ("ip", "netns", "exec", reader.namespace, "nft")
    with sending(sender), ExitStack() as behind:
        behind.callback(subprocess.run, [*words, "flush", "ruleset"], check=True, timeout=10)
        for place in ("udp dport { 1000-1300, 2000 } accept", "counter"):
            subprocess.run([*words, "flush", "ruleset"], check=True, timeout=10)
            subprocess.run([*words, "-f", "-"], input=rules.replace("PLACE", place), text=True, check=True, timeout=10)
            found = asked(reader)
            assert of_state(found, "problem") == []  # a capture sees it all the same
            assert ("firewall" in of_state(found, "ok")) == place.startswith("udp")
        plain = asked(reader, "udp://0.0.0.0:1202")
    assert of_state(plain, "problem") == ["firewall"]
    assert plain["verdict"].endswith("; but the firewall drops UDP 1202")
    assert "no program got one" in seen(plain, "firewall")


def test_what_comes_does_not_reach_programs_for_another_reason() -> None:
    """The reverse-path filter: answers to the sender would go out by another interface."""
    strict = ("net.ipv4.conf.all.rp_filter=1", "net.ipv4.conf.default.rp_filter=1")
    with routed() as (sender, _, reader):
        subprocess.run(["ip", "netns", "exec", reader.namespace, "sysctl", "-qw", *strict], check=True, timeout=10)
        with sending(sender, "10.77.0.2"):
            found = asked(reader)
    assert "firewall" in of_state(found, "note")
    assert "no program got one" in seen(found, "firewall")
