"""Privileges: what is needed to open an interface is given up once it is open."""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from contextlib import suppress

_CAPSET = {"x86_64": 126, "aarch64": 91, "armv7l": 185, "armv6l": 185, "i686": 185, "riscv64": 91}
_VERSION_3 = 0x20080522
_CHOWN, _DAC_OVERRIDE, _DAC_READ_SEARCH, _FOWNER = 0, 1, 2, 3
_PR_SET_NO_NEW_PRIVS = 38


def drop_privileges() -> None:
    """Give up all privileges but those over files; under sudo, become the person who called it.

    What is written then belongs to that person. Nothing happens for who has none. Of threads, it is for the one that
    calls, and those that it makes later: it has to be called before there are others.
    """
    if not sys.platform.startswith("linux"):
        return
    person, group = _number("SUDO_UID"), _number("SUDO_GID")
    if os.geteuid() == 0 and person and group:
        with suppress(OSError):
            os.setgroups([group])
            os.setgid(group)
            os.setuid(person)
        return
    _keep_only(sum(1 << number for number in (_CHOWN, _DAC_OVERRIDE, _DAC_READ_SEARCH, _FOWNER)))


def _keep_only(wanted: int) -> None:
    """Give up all capabilities but those wanted, of those that are there."""
    number = _CAPSET.get(os.uname().machine)
    if number is None:
        return
    kept = _effective() & wanted
    library = ctypes.CDLL(None, use_errno=True)
    header = ctypes.create_string_buffer(struct.pack("=Ii", _VERSION_3, 0))
    low, high = kept & 0xFFFFFFFF, kept >> 32
    sets = ctypes.create_string_buffer(struct.pack("=6I", low, low, 0, high, high, 0))
    library.syscall(ctypes.c_long(number), header, sets)
    library.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)


def _effective() -> int:
    """Return the capabilities that this process has."""
    try:
        with open("/proc/self/status", encoding="ascii") as status:
            return next((int(line.split()[1], 16) for line in status if line.startswith("CapEff:")), 0)
    except OSError:
        return 0


def _number(name: str) -> int:
    text = os.environ.get(name, "")
    return int(text) if text.isascii() and text.isdigit() else 0
