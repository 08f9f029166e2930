"""What the C library does with memory that is given back."""

from __future__ import annotations

import sys

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3  # malloc.h
_KEPT_BYTES = 64 << 20


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
