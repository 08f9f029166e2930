"""CAN logs: nvscope beside python-can merely reading, and beside cantools decoding the same frames.

    python tests/benchmarks/can_readers.py make FILE --frames 10000000 [--kind pdo|mixed|fd|values]
    python tests/benchmarks/can_readers.py measure FILE [--limit 500000] [--runs 3] [--definitions DIRECTORY]

Every job is a whole process, pinned to one core, in turn with the others; medians are shown, and the peak of memory.
python-can and cantools take the first ``--limit`` frames only: their speed does not depend on how many follow. A log of
kind ``values`` has four INT in each frame of 40 COB-IDs; ``make`` writes their definitions to FILE.gvl/, and a database
for cantools beside them; with ``--definitions FILE.gvl`` all variables are decoded, by nvscope into a Parquet file.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import time
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from statistics import median

_BEGIN_US = 1_436_509_052_000_000
_PIECE_LINES = 200_000
_FIRST, _COB_IDS = 0x181, 40
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
                identifier = f"{_FIRST + number % _COB_IDS:03X}"
                body = payload[:16] if kind == "values" else payload[: (16, 16, 16, 8, 4, 12)[number % 6]]
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
    if kind == "values":
        make_definitions(Path(f"{path}.gvl"))


def make_definitions(directory: Path) -> None:
    """Write what is in the frames of a log of kind ``values``: for nvscope, and as a database for cantools."""
    directory.mkdir(exist_ok=True)
    messages = []
    for place in range(_COB_IDS):
        names = [f"n{place}_{part}" for part in range(4)]
        declared = "; ".join(f"{name} : INT" for name in names)
        (directory / f"list{place}.gvl").write_text(
            f"<GVL><Declarations><![CDATA[VAR_GLOBAL {declared}; END_VAR]]></Declarations>"
            f'<NetvarSettings Protocol="CAN"><ListIdentifier>{_FIRST + place}</ListIdentifier></NetvarSettings></GVL>'
        )
        signals = "".join(f' SG_ {name} : {16 * at}|16@1- (1,0) [0|0] "" X\n' for at, name in enumerate(names))
        messages.append(f"BO_ {_FIRST + place} list{place}: 8 X\n{signals}")
    (directory / "values.dbc").write_text('VERSION ""\nNS_ :\nBS_:\nBU_: X\n' + "\n".join(messages))


def decode(path: str, definitions: str, limit: int | None) -> int:
    """Return the number of values that cantools decodes, none of which is kept."""
    import cantools  # noqa: PLC0415
    from can.io.canutils import CanutilsLogReader  # noqa: PLC0415

    database = cantools.database.load_file(str(Path(definitions) / "values.dbc"))
    messages = islice(CanutilsLogReader(path), limit)
    return sum(len(database.decode_message(message.arbitration_id, message.data)) for message in messages)


def read(path: str, library: str, limit: int | None) -> int:
    """Return the number of frames."""
    # Imported here: a process that measures one library must not pay for the others.
    if library == "python-can":
        from can.io.canutils import CanutilsLogReader  # noqa: PLC0415

        return sum(1 for _ in islice(CanutilsLogReader(path), limit))
    from nvscope.capture.open import open_source  # noqa: PLC0415

    return sum(len(batch) for batch in open_source([path]))


@dataclass
class Job:
    """A process to be measured, and how many frames it takes; ``taken`` are its times and the peak of its memory."""

    name: str
    frames: int
    command: list[str]
    taken: list[tuple[float, float, int]] = field(default_factory=list)

    def run(self, core: int) -> None:
        begun = time.perf_counter()
        with subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            os.sched_setaffinity(process.pid, {core})
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            sys.exit(f"{self.name}: exit code {process.returncode}")
        self.taken.append((time.perf_counter() - begun, usage.ru_utime + usage.ru_stime, usage.ru_maxrss))

    @property
    def row(self) -> tuple[float, float, int]:
        """Median of elapsed and of processor time in seconds, and the peak of memory in KiB."""
        elapsed, cpu, peak = zip(*self.taken, strict=True)
        return median(elapsed), median(cpu), max(peak)


def measure(path: str, limit: int, runs: int, definitions: str | None) -> None:
    whole = read(path, "nvscope", None)
    here, some = [sys.executable, str(Path(__file__))], min(whole, limit)
    nvscope = [sys.executable, "-m", "nvscope"]
    jobs = [
        Job("nvscope, reading", whole, [*here, "read", path, "nvscope"]),
        Job("nvscope report", whole, [*nvscope, "report", "-q", path]),
        Job("python-can, reading", some, [*here, "read", path, "python-can", "--limit", str(limit)]),
    ]
    if definitions:
        lists = [part for file in sorted(Path(definitions).glob("*.gvl")) for part in ("--gvl", str(file))]
        target = str(Path(definitions) / "values.parquet")
        jobs += [
            Job("nvscope report, lists", whole, [*nvscope, "report", "-q", path, *lists]),
            Job("nvscope export", whole, [*nvscope, "export", "-q", path, *lists, "-w", target]),
            Job("cantools, decoding", some, [*here, "decode", path, definitions, "--limit", str(limit)]),
        ]
    core = max(os.sched_getaffinity(0))
    for _ in range(runs):
        for job in jobs:
            job.run(core)
    sys.stdout.write(f"{path}: {whole} frames, {os.path.getsize(path) >> 20} MiB\n")
    for job in jobs:
        elapsed, cpu, peak = job.row
        rate = job.frames / elapsed / 1e6
        sys.stdout.write(f"{job.name:<22}{elapsed:8.2f} s{cpu:8.2f} s of CPU{rate:9.3f} M frames/s{peak >> 10:8} MiB\n")


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare readers of candump logs.")
    verbs = parser.add_subparsers(dest="verb", required=True)
    verb = verbs.add_parser("make")
    verb.add_argument("file")
    verb.add_argument("--frames", type=int, default=10_000_000)
    verb.add_argument("--kind", choices=("pdo", "mixed", "fd", "values"), default="pdo")
    verb = verbs.add_parser("measure")
    verb.add_argument("file")
    verb.add_argument("--limit", type=int, default=500_000)
    verb.add_argument("--runs", type=int, default=3)
    verb.add_argument("--definitions")
    verb = verbs.add_parser("read")
    verb.add_argument("file")
    verb.add_argument("library", choices=("nvscope", "python-can"))
    verb.add_argument("--limit", type=int)
    verb = verbs.add_parser("decode")
    verb.add_argument("file")
    verb.add_argument("definitions")
    verb.add_argument("--limit", type=int)
    arguments = parser.parse_args()
    if arguments.verb == "make":
        make(arguments.file, arguments.frames, arguments.kind)
    elif arguments.verb == "measure":
        measure(arguments.file, arguments.limit, arguments.runs, arguments.definitions)
    elif arguments.verb == "decode":
        sys.stdout.write(f"{decode(arguments.file, arguments.definitions, arguments.limit)}\n")
    else:
        sys.stdout.write(f"{read(arguments.file, arguments.library, arguments.limit)}\n")


if __name__ == "__main__":
    main()
