"""Waiting for live sources: until one of them has something, or time has passed, or somebody says stop."""

from __future__ import annotations

import select
import socket
import sys
from collections.abc import Collection
from contextlib import suppress

_HAS_POLL = hasattr(select, "poll")


class Wait:
    """Waits for several descriptors at once; sources that are read beside each other share one.

    ``wake`` ends a wait, and all later ones; for any thread and from signal handlers.
    """

    def __init__(self) -> None:
        self._descriptors: set[int] = set()
        # A pair of sockets: on Windows, select knows nothing else.
        self._end, self._ender = socket.socketpair()
        self._ender.setblocking(False)
        self.woken = False

    def add(self, descriptor: int) -> None:
        """Wait for a descriptor, too."""
        self._descriptors.add(descriptor)

    def remove(self, descriptor: int) -> None:
        """Wait for a descriptor no longer."""
        self._descriptors.discard(descriptor)

    def wake(self) -> None:
        """End the wait, and let no other one wait."""
        self.woken = True
        with suppress(OSError):  # it is full of such words already
            self._ender.send(b"\0")

    def wait(self, timeout_ns: int) -> None:
        """Wait until a descriptor has something to be read, or is broken, at most ``timeout_ns``."""
        self._wait(timeout_ns, self._descriptors)

    def pause(self, timeout_ns: int) -> None:
        """Wait ``timeout_ns``, whatever comes in."""
        self._wait(timeout_ns, ())

    def _wait(self, timeout_ns: int, descriptors: Collection[int]) -> None:
        timeout_ns = max(timeout_ns, 0)
        everything = [self._end.fileno(), *descriptors]
        if not _HAS_POLL or sys.platform == "win32":
            select.select(everything, [], [], timeout_ns / 1e9)
            return
        poll = select.poll()
        for descriptor in everything:
            poll.register(descriptor, select.POLLIN)
        poll.poll(-(-timeout_ns // 1_000_000))

    def close(self) -> None:
        """Close what it waits with; the descriptors are those of others."""
        self._end.close()
        self._ender.close()
