"""What the C library does with memory that is given back, and how often Python looks for what nobody needs."""

from __future__ import annotations

import atexit
import gc
import sys

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3  # malloc.h
_KEPT_BYTES = 64 << 20
_SELDOM = 50_000, 20, 100


def keep_freed_memory() -> None:
    """Let glibc keep some freed memory for what is allocated next; elsewhere do nothing.

    Columns of a batch are allocated and freed all the time. By default glibc returns such blocks to the system at once
    and gets them back page by page, which takes a fifth of the time of a long run.
    """
    if not sys.platform.startswith("linux"):
        return
    import ctypes

    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return
    for parameter in (_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_TOP_PAD):
        mallopt(parameter, _KEPT_BYTES)


def look_for_cycles_seldom() -> None:
    """Let Python look less often for objects that only refer to each other: there are few, and no large ones.

    By default it looks after each 700 objects more, which at the start, with all its classes and functions, is a
    twentieth of the time.
    """
    gc.set_threshold(*_SELDOM)


def leave_the_rest_at_exit() -> None:
    """Let Python end without looking for objects that only refer to each other: they go with the process.

    That search goes through all modules several times, and takes a tenth of the time of a short run. What has to be
    written is written before: no file waits for its object to go.
    """
    atexit.register(gc.freeze)
