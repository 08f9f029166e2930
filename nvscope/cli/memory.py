"""What the C library does with memory that is given back, and how often Python looks for what nobody needs."""

from __future__ import annotations

import atexit
import gc
import mmap
import sys
from typing import Any

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3  # malloc.h
_KEPT_BYTES = 64 << 20
_GROWTH_BYTES = 1 << 20
_SELDOM = 50_000, 20, 100


def keep_freed_memory() -> None:
    """Let glibc keep some freed memory for what is allocated next; elsewhere do nothing.

    Columns of a batch are allocated and freed all the time. By default glibc returns such blocks to the system at once
    and gets them back page by page, which takes a fifth of the time of a long run. Not for live sources: theirs are
    small, and what goes on for weeks must not keep more and more.
    """
    if not sys.platform.startswith("linux"):
        return
    import ctypes

    try:
        libc = ctypes.CDLL(None)
        mallopt = libc.mallopt
    except (OSError, AttributeError):
        return
    for parameter in (_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_TOP_PAD):
        mallopt(parameter, _KEPT_BYTES)
    _grow_in_large_pages(libc)


def _grow_in_large_pages(libc: Any) -> None:
    """Let the heap grow by what it pads itself with, in pages of 2 MB where the system has them.

    The columns of a batch are read and written at places that lie apart: with pages of 4 KB each place costs a look
    into the page table. What the system does not give changes nothing.
    """
    import ctypes

    libc.sbrk.restype, libc.sbrk.argtypes = ctypes.c_void_p, (ctypes.c_ssize_t,)
    libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, (ctypes.c_size_t,)
    libc.free.restype, libc.free.argtypes = None, (ctypes.c_void_p,)
    libc.madvise.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    end = libc.sbrk(0)
    # More than is free at the end of a heap that has not padded itself yet.
    libc.free(libc.malloc(_GROWTH_BYTES))
    start = -(-end // mmap.PAGESIZE) * mmap.PAGESIZE
    libc.madvise(start, libc.sbrk(0) - start, mmap.MADV_HUGEPAGE)


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
