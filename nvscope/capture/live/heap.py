"""Heap: gives memory back to the system that a program has freed, so that it does not seem to grow for weeks."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

EVERY_NS = 5_000_000_000
"""So often; less often than columns of batches are freed and allocated again, which would cost time."""


class Heap:
    """The heap of the C library where that can give back what lies free between what is in use, which glibc can.

    Columns of many sizes come and go while a source is read: what is free would otherwise lie in ever more places.
    """

    def __init__(self) -> None:
        self._given_ns = time.monotonic_ns()
        self._trim = _trim()

    def give_back(self) -> None:
        """Give back what is free, if that has not been done for a while."""
        now_ns = time.monotonic_ns()
        if self._trim is not None and now_ns - self._given_ns >= EVERY_NS:
            self._trim(0)
            self._given_ns = now_ns


def _trim() -> Callable[[int], int] | None:
    """Return the function of the C library, None where it has none."""
    if not sys.platform.startswith("linux"):
        return None
    import ctypes  # noqa: PLC0415  not for who reads files

    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (OSError, AttributeError):
        return None
    trim.argtypes, trim.restype = (ctypes.c_size_t,), ctypes.c_int
    return trim
