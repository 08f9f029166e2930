"""Read a candump log: by nvscope, by its report, and by python-can merely reading; each as a whole process.

    python tests/benchmarks/can_readers.py make FILE --frames 10000000 [--kind pdo|mixed|fd]
    python tests/benchmarks/can_readers.py measure FILE [--limit 500000] [--runs 3]

``measure`` prints time, frames per second and the peak of memory, of the fastest run. python-can reads the first
``--limit`` frames only: its speed does not depend on how many follow.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import time
from itertools import islice
from pathlib import Path

_BEGIN_US = 1_436_509_052_000_000
_PIECE_LINES = 200_000
_FD_LENGTHS = (8, 12, 16, 20, 24, 32, 48, 64)


def make(path: str, frames: int, kind: str) -> None:
    """Write a log as candump does: PDOs of two buses; ``mixed`` with extended, remote and error frames between them."""
    chance = random.Random(1)
    payloads = [chance.randbytes(64).hex().upper() for _ in range(4096)]
    now_us = _BEGIN_US
    with open(path, "w", encoding="ascii") as file:
        for done in range(0, frames, _PIECE_LINES):
            lines = []
            for number in range(done, min(done + _PIECE_LINES, frames)):
                now_us += 40 + number * 7919 % 97
                payload = payloads[number * 31 % 4096]
                identifier = f"{0x181 + number % 40:03X}"
                body = payload[: (16, 16, 16, 8, 4, 12)[number % 6]]
                if kind == "fd" and number % 2:
                    body = f"#1{payload[: 2 * _FD_LENGTHS[number % 8]]}"
                elif kind == "mixed" and number % 5 == 0:
                    identifier = f"{0x18FF0000 + number % 256:08X}"
                elif kind == "mixed" and number % 211 == 0:
                    body = "R8"
                elif kind == "mixed" and number % 1009 == 0:
                    identifier, body = "20000004", "000C000000000000"
                lines.append(f"({now_us // 10**6:010d}.{now_us % 10**6:06d}) can{number & 1} {identifier}#{body}\n")
            file.write("".join(lines))


def read(path: str, library: str, limit: int | None) -> int:
    """Return the number of frames."""
    # Imported here: a process that measures one library must not pay for the others.
    if library == "python-can":
        from can.io.canutils import CanutilsLogReader  # noqa: PLC0415

        return sum(1 for _ in islice(CanutilsLogReader(path), limit))
    from nvscope.capture.open import open_source  # noqa: PLC0415

    return sum(len(batch) for batch in open_source([path]))


def measure(path: str, limit: int, runs: int) -> None:
    whole = read(path, "nvscope", None)
    here = [sys.executable, str(Path(__file__)), "read", path]
    jobs = (
        ("nvscope, reading", whole, [*here, "nvscope"]),
        ("nvscope report", whole, [sys.executable, "-m", "nvscope", "report", path]),
        ("python-can, reading", min(whole, limit), [*here, "python-can", "--limit", str(limit)]),
    )
    sys.stdout.write(f"{path}: {whole} frames, {os.path.getsize(path) >> 20} MiB\n")
    for name, frames, command in jobs:
        seconds, cpu, peak_kib = [], [], 0
        for _ in range(runs):
            begun = time.perf_counter()
            with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
                _, _, usage = os.wait4(process.pid, 0)
                process.returncode = 0
            seconds.append(time.perf_counter() - begun)
            cpu.append(usage.ru_utime + usage.ru_stime)
            peak_kib = max(peak_kib, usage.ru_maxrss)
        rate = frames / min(seconds) / 1e6
        sys.stdout.write(
            f"{name:<22}{min(seconds):8.2f} s{min(cpu):8.2f} s of CPU{rate:9.3f} M frames/s{peak_kib >> 10:8} MiB\n"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare readers of candump logs.")
    verbs = parser.add_subparsers(dest="verb", required=True)
    verb = verbs.add_parser("make")
    verb.add_argument("file")
    verb.add_argument("--frames", type=int, default=10_000_000)
    verb.add_argument("--kind", choices=("pdo", "mixed", "fd"), default="pdo")
    verb = verbs.add_parser("measure")
    verb.add_argument("file")
    verb.add_argument("--limit", type=int, default=500_000)
    verb.add_argument("--runs", type=int, default=3)
    verb = verbs.add_parser("read")
    verb.add_argument("file")
    verb.add_argument("library", choices=("nvscope", "python-can"))
    verb.add_argument("--limit", type=int)
    arguments = parser.parse_args()
    if arguments.verb == "make":
        make(arguments.file, arguments.frames, arguments.kind)
    elif arguments.verb == "measure":
        measure(arguments.file, arguments.limit, arguments.runs)
    else:
        sys.stdout.write(f"{read(arguments.file, arguments.library, arguments.limit)}\n")


if __name__ == "__main__":
    main()
