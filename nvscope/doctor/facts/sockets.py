"""Who has UDP ports of this machine: the kernel's table of sockets, and the processes that hold them."""

from __future__ import annotations

import errno
import os
import socket
import struct
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress

from msgspec import Struct
from msgspec.structs import replace

_TABLES = ("/proc/net/udp", "/proc/net/udp6")
_LOOPBACK_PROBE = "127.77.12.2"
_MOST_SOCKETS = 10_000


class BoundPort(Struct, frozen=True):
    """A UDP socket with a port: ``address`` is what it is bound to, ``user`` the number of its owner.

    ``process`` is the holder as people know it, such as ``codesyscontrol (PID 812)``; "" where that may not be seen.
    ``is_shared``: its holder lets others have it too, None where that is not known.
    """

    port: int
    address: str
    user: int
    inode: int
    process: str = ""
    is_shared: bool | None = None

    @property
    def is_for_all(self) -> bool:
        """Whether it takes what is sent to any address."""
        return self.address in ("0.0.0.0", "::")

    @property
    def told(self) -> str:
        """The holder, or who that is of."""
        return self.process or f"a process of {_user(self.user)}"


def bound_ports() -> Sequence[BoundPort]:
    """Return the UDP sockets of this machine, those of other network namespaces aside."""
    return [entry for table in _TABLES for entry in _read(table)][:_MOST_SOCKETS]


def looked_into(entries: Sequence[BoundPort], ports: Collection[int]) -> Sequence[BoundPort]:
    """Return sockets, those of some ports with the processes that hold them, as far as this user may see these."""
    chosen = [entry for entry in entries if entry.port in ports]
    holders = _holders({entry.inode for entry in chosen})
    shared = {entry.port: _is_shared(entry.port) for entry in chosen if entry.is_for_all}
    return [
        replace(entry, process=holders.get(entry.inode, ""), is_shared=shared.get(entry.port))
        if entry.port in ports else entry for entry in entries
    ]  # fmt: skip


def _is_shared(port: int) -> bool | None:
    """Return whether whoever holds a port for all addresses lets others have it too; None where that cannot be tried.

    It is tried at an address of the loopback that nobody uses, so that nothing is taken from the one who holds it.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_LOOPBACK_PROBE, port))
        except OSError as error:
            return False if error.errno == errno.EADDRINUSE else None
    return True


def _read(table: str) -> Iterator[BoundPort]:
    try:
        with open(table, encoding="ascii") as file:
            next(file, None)
            for line in file:
                words = line.split()
                address, _, port = words[1].partition(":")
                yield BoundPort(int(port, 16), _address(address), int(words[7]), int(words[9]))
    except (OSError, ValueError, IndexError):
        return


def _address(told: str) -> str:
    """Return an address as the kernel writes it: in hexadecimal, each word of four bytes in the order of this CPU."""
    raw = b"".join(struct.pack("=I", int(told[at : at + 8], 16)) for at in range(0, len(told), 8))
    return socket.inet_ntop(socket.AF_INET if len(raw) == 4 else socket.AF_INET6, raw)


def _holders(inodes: set[int]) -> dict[int, str]:
    """Return the processes that hold sockets, by the inodes of these."""
    wanted = {f"socket:[{inode}]": inode for inode in inodes}
    found: dict[int, str] = {}
    if not wanted:
        return found
    for process in os.listdir("/proc"):
        if not process.isdigit():
            continue
        with suppress(OSError), os.scandir(f"/proc/{process}/fd") as entries:  # those of others are not ours to see
            for entry in entries:
                with suppress(OSError):
                    inode = wanted.get(os.readlink(entry.path))
                    if inode is not None:
                        found.setdefault(inode, f"{_name(process)} (PID {process})")
    return found


def _name(process: str) -> str:
    try:
        with open(f"/proc/{process}/comm", encoding="utf-8", errors="replace") as file:
            return file.read().strip()
    except OSError:
        return "a process"


def _user(number: int) -> str:
    try:
        import pwd  # noqa: PLC0415  not there on Windows

        return f"user {pwd.getpwuid(number).pw_name}"
    except (ImportError, KeyError):
        return f"user {number}"
