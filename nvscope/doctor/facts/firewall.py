"""What the firewall of this machine lets in, as far as its rules may be read; never a guess.

Rules are read with ``nft`` or ``iptables-save``, which takes root. Without, files tell whether a firewall is switched
on, and not what it lets in.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence

from msgspec import Struct

from nvscope.doctor.facts.firewall_rules import Fate, Packet, fate_of
from nvscope.doctor.facts.iptables_rules import chains_of_iptables
from nvscope.doctor.facts.nft_rules import chains_of_nft

_LONGEST_S = 3
_PLACES = "/usr/sbin:/sbin:/usr/bin:/bin"
_UFW = "/etc/ufw/ufw.conf"
_ON = re.compile(r"^\s*ENABLED\s*=\s*yes\b", re.IGNORECASE | re.MULTILINE)
_DAEMONS = ("firewalld",)
_MOST_FATES = 64


class Firewall(Struct, frozen=True):
    """``fates`` is what becomes of a telegram by interface and port; empty where the rules may not be read.

    ``read_with`` is the program that read them, "" for none; ``clues`` are sentences on what else was seen of it.
    """

    fates: tuple[tuple[str, int, Fate], ...] = ()
    read_with: str = ""
    clues: tuple[str, ...] = ()


def firewall(ports: Sequence[int], interfaces: Sequence[str]) -> Firewall:
    """Ask what becomes of UDP to some ports that comes in by some interfaces."""
    clues = tuple(_clues())
    for read_with, words, chains_of in (
        ("nft", ("-j", "list", "ruleset"), lambda text: chains_of_nft(json.loads(text))),
        ("iptables-save", (), chains_of_iptables),
    ):
        text = _output(read_with, words)
        if text is None:
            continue
        try:
            chains = chains_of(text)
        except (ValueError, TypeError, AttributeError, KeyError):
            continue
        fates = [
            (name, port, fate_of(chains, Packet(name, port))) for name in interfaces or [""] for port in ports
        ]  # fmt: skip
        return Firewall(tuple(fates[:_MOST_FATES]), read_with, clues)
    return Firewall((), "", clues)


def _output(program: str, words: Sequence[str]) -> str | None:
    """Return what a program prints that may be called, None where it may not, or is not there."""
    path = shutil.which(program, path=_PLACES)
    if path is None or os.geteuid():
        return None
    try:
        done = subprocess.run(
            [path, *words], stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=_LONGEST_S,
            env={"LC_ALL": "C", "PATH": _PLACES}, text=True, errors="replace",
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout if done.returncode == 0 else None


def _clues() -> Iterator[str]:
    try:
        with open(_UFW, encoding="utf-8", errors="replace") as file:
            if _ON.search(file.read(1 << 16)):
                yield f"ufw is switched on ({_UFW})"
    except OSError:
        pass
    running = set(_running())
    yield from (f"{name} runs" for name in _DAEMONS if name in running)


def _running() -> Iterator[str]:
    for process in os.listdir("/proc"):
        if process.isdigit():
            try:
                with open(f"/proc/{process}/comm", encoding="utf-8", errors="replace") as file:
                    yield file.read().strip()
            except OSError:
                continue
