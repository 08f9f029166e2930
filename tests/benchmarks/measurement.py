"""One process measured: its time, and the peak of its memory. Needs Linux."""

from __future__ import annotations

import os
import statistics
import subprocess
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

SAMPLE_SECONDS = 0.02


def usual_environment() -> dict[str, str]:
    """Return the environment as a person has it: Python's modules are compiled once, whatever is set here."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


@dataclass(frozen=True)
class Run:
    """One process: seconds of wall and processor time, and the peak of its memory in bytes."""

    wall_s: float
    cpu_s: float
    rss_bytes: int
    anonymous_bytes: int


def median(runs: list[Run], name: str) -> float:
    """Return the median of one figure over some runs."""
    return float(statistics.median(getattr(run, name) for run in runs))


class ProcessError(Exception):
    """A process ended with an exit code that is no success."""


def measure(command: list[str], core: int | None, output: Path | None = None) -> Run:
    """Run one process pinned to one core, None for those of the machine; raises ProcessError where it ends badly.

    nvscope's exit code 3 (data loss found) is a success.
    """
    with (
        open(output or os.devnull, "wb") as out,
        tempfile.TemporaryFile() as errors,
    ):
        # A process inherits the cores of the thread that starts it.
        elsewhere = os.sched_getaffinity(0)
        if core is not None:
            os.sched_setaffinity(0, {core})
        started = time.perf_counter()
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=errors,
            env=usual_environment(),
        )
        os.sched_setaffinity(0, elsewhere)
        sampler = MemorySampler(process.pid)
        sampler.start()
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - started
        sampler.stop()
        process.returncode = code = os.waitstatus_to_exitcode(status)
        if code not in (0, 3):
            errors.seek(0)
            lines = errors.read().decode(errors="replace").strip().splitlines() or [""]
            raise ProcessError(f"{' '.join(command[:3])} … ended with exit code {code}: {lines[-1]}")
    return Run(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024, sampler.peak_bytes)


class MemorySampler(threading.Thread):
    """Watches the anonymous memory of a process and of its children, which leaves out the pages of mapped files.

    What several share counts for each: who shares it would have to be looked for page by page, which takes them time.
    ``samples`` take what they held when, in seconds and bytes.
    """

    def __init__(self, pid: int, samples: list[tuple[float, int]] | None = None) -> None:
        super().__init__(daemon=True)
        self.peak_bytes = 0
        self._samples = samples
        self._pid = pid
        self._ended = threading.Event()

    def run(self) -> None:
        while not self._ended.wait(SAMPLE_SECONDS):
            held_bytes = _held_bytes(self._pid)
            if held_bytes:
                self.peak_bytes = max(self.peak_bytes, held_bytes)
                if self._samples is not None:
                    self._samples.append((time.monotonic(), held_bytes))

    def stop(self) -> None:
        self._ended.set()
        self.join()


def _held_bytes(pid: int) -> int:
    """Return what a process and its children hold, 0 of one that has gone."""
    held_bytes = 0
    try:
        with open(f"/proc/{pid}/status") as status:
            for line in status:
                if line.startswith(("RssAnon:", "RssShmem:")):
                    held_bytes += int(line.split()[1]) * 1024
        with open(f"/proc/{pid}/task/{pid}/children") as children:
            held_bytes += sum(_held_bytes(int(child)) for child in children.read().split())
    except OSError:
        pass
    return held_bytes
