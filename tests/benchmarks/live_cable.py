"""Two network namespaces with a cable between them, for this program alone. Needs root and iproute2."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

SETTINGS = ("net.ipv6.conf.all.disable_ipv6=1", "net.ipv4.conf.all.rp_filter=0", "net.ipv4.conf.default.rp_filter=0")


@dataclass(frozen=True)
class End:
    """One end of the cable: a namespace and its interface."""

    namespace: str
    device: str

    def words(self, *command: str) -> list[str]:
        """Return the words that run a command at this end."""
        return ["ip", "netns", "exec", self.namespace, *command]

    def rings(self) -> int:
        """Return how many packet sockets take in packets here."""
        told = subprocess.run(self.words("cat", "/proc/net/packet"), capture_output=True, text=True, check=True)
        # sk RefCnt Type Proto Iface R Rmem User Inode
        return sum(line.split()[5] == "1" for line in told.stdout.splitlines()[1:])

    def listens(self) -> bool:
        """Return whether somebody listens on a UDP port here."""
        told = subprocess.run(self.words("cat", "/proc/net/udp"), capture_output=True, text=True, check=True)
        return len(told.stdout.splitlines()) > 1


@contextmanager
def cable() -> Iterator[tuple[End, End]]:
    """Yield the sending and the receiving end; both are gone behind it."""
    ends = [End(f"nvb{os.getpid()}{side}", f"nvb{side}") for side in "ab"]
    made: list[str] = []

    def run(*words: str) -> None:
        subprocess.run(words, check=True, timeout=10)

    try:
        for end in ends:
            run("ip", "netns", "add", end.namespace)
            made.append(end.namespace)
            run(*end.words("sysctl", "-qw", *SETTINGS))
        sender, receiver = ends
        peer = ["peer", "name", receiver.device, "netns", receiver.namespace]
        run("ip", "link", "add", sender.device, "netns", sender.namespace, "mtu", "1600", "type", "veth", *peer)
        run("ip", "-n", receiver.namespace, "link", "set", receiver.device, "mtu", "1600")
        # The nodes of the plants have addresses of this network.
        run("ip", "-n", receiver.namespace, "addr", "add", "192.0.2.200/24", "dev", receiver.device)
        for end in ends:
            run("ip", "-n", end.namespace, "link", "set", end.device, "up")
        yield sender, receiver
    finally:
        for namespace in made:
            subprocess.run(["ip", "netns", "del", namespace], check=False, timeout=10)
