"""Hosts of our own on this machine: network namespaces, and what is sent between them.

Nothing leaves the machine: each namespace has a loopback and cables to others that are made here.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import pytest


def _can_make_namespaces() -> bool:
    if not sys.platform.startswith("linux") or shutil.which("ip") is None or os.geteuid():
        return False
    name = f"nvt{uuid.uuid4().hex[:8]}"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, check=False).returncode == 0
    if made:
        subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)
    return made


needs_namespaces = pytest.mark.skipif(not _can_make_namespaces(), reason="needs root and ip (iproute2)")


@dataclass(frozen=True)
class Host:
    """A host: a network namespace with one interface, ``device``, and an address on it."""

    namespace: str
    device: str
    address: str

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Start a program on the host."""
        return subprocess.Popen(
            ["ip", "netns", "exec", self.namespace, *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def nvscope(self, *words: str) -> subprocess.Popen[str]:
        """Start nvscope on the host."""
        return self.start(sys.executable, "-m", "nvscope", *words)

    def python_program(self, text: str, *words: str) -> subprocess.Popen[str]:
        """Start a Python program on the host."""
        return self.start(sys.executable, "-c", text, *words)

    def python(self, text: str, *words: str) -> None:
        """Run a Python program on the host to its end."""
        subprocess.run(
            ["ip", "netns", "exec", self.namespace, sys.executable, "-c", text, *words], check=True, timeout=30
        )

    def ip(self, *words: str) -> None:
        """Change something of the host's network."""
        subprocess.run(["ip", "-n", self.namespace, *words], check=True, timeout=10)


@contextmanager
def cable() -> Iterator[tuple[Host, Host]]:
    """Yield two hosts with a cable between them; both are gone behind it."""
    name = uuid.uuid4().hex[:6]
    hosts = [Host(f"nvt{name}{end}", f"v{name}{end}", f"10.77.0.{place}") for place, end in enumerate("ab", 1)]
    made: list[str] = []

    def run(*words: str) -> None:
        subprocess.run(["ip", *words], check=True, timeout=10)

    try:
        for host in hosts:
            run("netns", "add", host.namespace)
            made.append(host.namespace)
        first, second = hosts
        peer = ["peer", "name", second.device, "netns", second.namespace]
        run("link", "add", first.device, "netns", first.namespace, "type", "veth", *peer)
        for host in hosts:
            # No neighbour discovery: what is sent is what a test sends.
            for place in ("all", host.device):
                host_setting = f"net.ipv6.conf.{place}.disable_ipv6=1"
                subprocess.run(
                    ["ip", "netns", "exec", host.namespace, "sysctl", "-qw", host_setting],
                    check=False, capture_output=True, timeout=10,
                )  # fmt: skip
            host.ip("link", "set", "lo", "up")
            host.ip("addr", "add", f"{host.address}/24", "broadcast", "10.77.0.255", "dev", host.device)
            host.ip("link", "set", host.device, "up")
        yield first, second
    finally:
        for namespace in made:
            subprocess.run(["ip", "netns", "del", namespace], check=False, timeout=10)


SEND = """
import socket, struct, sys, time
target, count, lists, each_ns = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
first = int(sys.argv[5]) if len(sys.argv) > 5 else 1
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
out.bind(("", 1202))
begin = time.monotonic_ns()
for number in range(count):
    counter, index = divmod(number, lists)
    late = begin + number * each_ns - time.monotonic_ns()
    if late > 0:
        time.sleep(late / 1e9)
    data = struct.pack("<I", number)
    out.sendto(b"\\0-S3" + struct.pack("<IHHHHHBB", 0, first + index, 0, 1, 24, (counter + 1) & 0xFFFF, 0, 0) + data,
               (target, 1202))
"""
"""Sends telegrams: target, how many, of how many lists, one each so many nanoseconds, the first list's identifier."""


def send(target: str, count: int, lists: int = 2, each_ns: int = 1_000_000) -> Sequence[str]:
    """Return the words that start sending."""
    return [sys.executable, "-c", SEND, target, str(count), str(lists), str(each_ns)]
