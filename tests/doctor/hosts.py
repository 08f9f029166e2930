"""Hosts of our own that are asked for their diagnosis, and what happens on them meanwhile."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

import pytest

from nvscope.doctor.checks import CHECKS
from tests.capture.live.network import Host, cable
from tests.oracle.builders import telegram

SUBNET = "10.77.0.255"


_SEND = """
import socket, sys, time
target, port, payload = sys.argv[1], int(sys.argv[2]), bytes.fromhex(sys.argv[3])
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 4)
for number in range(10_000):
    try:
        out.sendto(payload, (target, port))
    except OSError:
        pass
    if not number:
        print("sent", flush=True)
    time.sleep(0.005)
"""
SEND_FRAMES = """
import socket, sys, time
out = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
out.bind((sys.argv[1], 0))
for number in range(10_000):
    out.send(bytes.fromhex(sys.argv[2]))
    if not number:
        print("sent", flush=True)
    time.sleep(0.005)
"""


_HOLD = """
import socket, sys, time
held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
if sys.argv[2] == "shared":
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
held.bind(("0.0.0.0", int(sys.argv[1])))
if len(sys.argv) > 3:
    group = socket.inet_aton(sys.argv[3]) + socket.inet_aton(sys.argv[4])
    held.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
print("held", flush=True)
time.sleep(60)
"""


NOBODY = ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--bounding-set=-all", "--inh-caps=-all")


def _nobody_can_run_it() -> bool:
    """Return whether a user without any rights may read the interpreter and the program."""
    words = [*NOBODY, sys.executable, "-c", "import nvscope, numpy"]
    return which("setpriv") is not None and not subprocess.run(words, capture_output=True, check=False).returncode


needs_nobody = pytest.mark.skipif(
    not _nobody_can_run_it(), reason="needs setpriv, and an interpreter that all may read"
)  # fmt: skip


@contextmanager
def running(process: subprocess.Popen[str], begun: str) -> Iterator[subprocess.Popen[str]]:
    """Have a program run meanwhile, from when it says that it has begun."""
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == f"{begun}\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def sending(host: Host, target: str = SUBNET, *, port: int = 1202, payload: bytes = b"") -> Any:
    """Let a host send telegrams of list 7 for some seconds."""
    words = (sys.executable, "-c", _SEND, target, str(port), (payload or telegram(list_id=7)).hex())
    return running(host.start(*words), "sent")


@contextmanager
def holding(host: Host, *words: str) -> Iterator[None]:
    """Let a program of a host have a UDP port, and be a member of a group."""
    with running(host.start(sys.executable, "-c", _HOLD, *words), "held"):
        yield


def asked(host: Host, *words: str, user: tuple[str, ...] = (), heard_for: str = "300ms") -> dict[str, Any]:
    """Return what the doctor says on a host; its exit code tells whether something is wrong."""
    command = (*user, sys.executable, "-m", "nvscope", "doctor", "--for", heard_for, "--json", *words)
    done = host.start(*command)
    out, said = done.communicate(timeout=30)
    assert done.returncode in (0, 1), said
    found: dict[str, Any] = json.loads(out)
    assert (done.returncode == 1) == bool(of_state(found, "problem")) == (found["state"] == "problem")
    assert {one["check"] for one in found["results"]} == {check.name for check in CHECKS}
    assert all(one["next"] for one in found["results"] if one["state"] in ("problem", "note"))
    return found


def of_state(found: dict[str, Any], state: str) -> list[str]:
    """Return the checks that have a state."""
    return [one["check"] for one in found["results"] if one["state"] == state]


def seen(found: dict[str, Any], check: str) -> str:
    return " ".join(one["seen"] for one in found["results"] if one["check"] == check)


@contextmanager
def settled(*, carrier: bool = True) -> Iterator[tuple[Host, Host]]:
    """Yield two hosts with a cable between them, of which the kernel knows by now whether it works."""
    with cable() as (first, second):
        wait_for_carrier(second, carrier=carrier)
        yield first, second


def wait_for_carrier(host: Host, *, carrier: bool) -> None:
    for _ in range(300):
        told = subprocess.run(
            ["ip", "-n", host.namespace, "-j", "link", "show", "dev", host.device], capture_output=True, check=True
        )
        if (json.loads(told.stdout)[0]["operstate"] == "UP") == carrier:
            return
        time.sleep(0.02)
    raise AssertionError("the kernel does not learn of the carrier")


@contextmanager
def renumbered(host: Host, address: str) -> Iterator[None]:
    """Give a host another address meanwhile."""
    for one in (address, None):
        host.ip("addr", "flush", "dev", host.device)
        host.ip("addr", "add", one or f"{host.address}/24", "broadcast", "+", "dev", host.device)
        if one:
            yield


def definition(folder: Path, target: str, port: int = 1202, name: str = "axis", number: int = 7) -> str:
    path = folder / f"{name}.gvl"
    path.write_text(
        f"<GVL><Declarations><![CDATA[VAR_GLOBAL\n n : INT;\nEND_VAR]]></Declarations>"
        f'<NetvarSettings Protocol="UDP"><ListIdentifier>{number}</ListIdentifier><Pack>True</Pack>'
        f'<ProtocolSettings><ProtocolSetting Name="Broadcast Adr." Value="{target}" />'
        f'<ProtocolSetting Name="Port" Value="{port}" /></ProtocolSettings></NetvarSettings></GVL>'
    )
    path.chmod(0o644)
    folder.chmod(0o755)
    return str(path)


@contextmanager
def routed() -> Iterator[tuple[Host, Host, Host]]:
    """Yield a sender, a router and a reader; the sender is in another network than the reader."""
    with settled() as (router, reader), cable() as (sender, between):
        sender.ip("addr", "flush", "dev", sender.device)
        sender.ip("addr", "add", "10.78.0.1/24", "dev", sender.device)
        between.ip("link", "set", between.device, "netns", router.namespace)
        router.ip("addr", "add", "10.78.0.2/24", "dev", between.device)
        router.ip("link", "set", between.device, "up")
        sender.ip("route", "add", "default", "via", "10.78.0.2")
        forward = ("ip", "netns", "exec", router.namespace, "sysctl", "-qw", "net.ipv4.ip_forward=1")
        subprocess.run(forward, check=True, timeout=10)
        yield sender, router, reader
