"""What the program itself takes of the machine: processor time of all its threads, memory, threads."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from pathlib import Path

from nvscope.view.lines.plant.source_blocks import OwnLoad

_SECONDS = 5.0
_STATM = Path("/proc/self/statm")


class OwnLoadMeter:
    """Measures over the last seconds: each ``measure`` compares with one that is about so long ago."""

    def __init__(self) -> None:
        self._taken: deque[tuple[float, float, int]] = deque()

    def measure(self, draws: int) -> OwnLoad:
        """Return what was taken lately; ``draws`` is how often the screen was drawn so far."""
        now_s, cpu_s = time.monotonic(), time.process_time()
        while len(self._taken) > 1 and now_s - self._taken[1][0] >= _SECONDS:
            self._taken.popleft()
        before = self._taken[0] if self._taken else None
        self._taken.append((now_s, cpu_s, draws))
        memory_bytes, at_most = _memory()
        passed_s = now_s - before[0] if before is not None else 0.0
        if before is None or passed_s <= 0:
            return OwnLoad(0.0, None, memory_bytes, at_most, threading.active_count(), None)
        return OwnLoad(
            passed_s, 100 * (cpu_s - before[1]) / passed_s, memory_bytes, at_most, threading.active_count(),
            (draws - before[2]) / passed_s,
        )  # fmt: skip


def _memory() -> tuple[int | None, bool]:
    """Return the bytes that are resident, and whether that is the most there ever were."""
    try:
        pages = int(_STATM.read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE"), False
    except (OSError, ValueError, IndexError):
        pass
    try:
        import resource  # noqa: PLC0415  not on Windows
    except ImportError:
        return None, False
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024, True
