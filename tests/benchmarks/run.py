"""Compare ``nvscope report --json`` with other ways to read the same capture, as whole processes on one core.

    python tests/benchmarks/run.py                                    1 M telegrams
    python tests/benchmarks/run.py --telegrams 1000000 10000000       and 10 M, with the growth from one to the other

Prints tables, asserts nothing about time. What the columns mean is in README.md beside this file. Needs Linux.
This process stays small on purpose (no numpy): the kernel counts the memory of the process that starts another one
into the other one's peak.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
LUA_DISSECTOR = HERE / "dissector.lua"
LUA_FIELDS = ("nv.index", "nv.subindex", "nv.counter", "nv.flags")
SCAPY_FRAMES = 20_000
START_UP_TELEGRAMS = 495  # and one frame in a hundred of other traffic: 500 frames
KINDS = ("cyclic", "events")  # as in generate.py, which needs numpy
FAST_LIMIT = 1_000_000
SAMPLE_SECONDS = 0.02
MIB = 1 << 20


@dataclass(frozen=True)
class Tool:
    """One way to read a capture: how it is called, and how many telegrams it says it saw."""

    name: str
    command: Callable[[Path], list[str]]
    missing: str | None = None
    seen: Callable[[Path], int | None] = lambda _: None
    expected: Callable[[dict[str, Any]], int | None] = lambda _: None
    frames: int | None = None  # reads only so many frames, and is extrapolated
    slow: bool = False


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


@dataclass
class Row:
    """The runs of one tool on one capture; ``note`` says why there are none, or how figures came about."""

    tool: Tool
    runs: list[Run] = field(default_factory=list)
    wall_s: float | None = None
    cpu_s: float | None = None
    seen: int | None = None
    note: str = ""

    def median(self, name: str) -> float:
        return median(self.runs, name)


class ProcessError(Exception):
    """A process ended with an exit code that is no success."""


def python(*arguments: str) -> list[str]:
    return [sys.executable, *arguments]


def nvscope_path() -> str | None:
    beside = Path(sys.executable).with_name("nvscope")
    return str(beside) if beside.exists() else shutil.which("nvscope")


def not_found(program: str | None, name: str) -> str | None:
    return None if program else f"{name} is not installed"


def whole_headers(truth: dict[str, Any]) -> int:
    return int(truth["telegrams"] - truth["kinds"]["short"])


def printed_number(output: Path) -> int:
    return int(output.read_text())


def filled_lines(output: Path) -> int:
    with output.open() as lines:
        return sum(not line.isspace() for line in lines)


def reported_telegrams(output: Path) -> int:
    return int(json.loads(output.read_text())["capture"]["telegrams"])


def tools() -> list[Tool]:
    nvscope, tshark, cksum = nvscope_path(), shutil.which("tshark"), shutil.which("cksum")
    library = {name: importlib.util.find_spec(name) is not None for name in ("dpkt", "scapy")}
    lua = ["-X", f"lua_script:{LUA_DISSECTOR}"]
    four_fields = [word for name in LUA_FIELDS for word in ("-e", name)]
    return [
        Tool(
            "nvscope report --json",
            lambda file: [str(nvscope), "report", "--json", str(file)],
            not_found(nvscope, "nvscope"),
            reported_telegrams,
            lambda truth: int(truth["telegrams"]),
        ),
        Tool("cksum (floor)", lambda file: ["cksum", str(file)], not_found(cksum, "cksum")),
        Tool(
            "dpkt loop",
            lambda file: python(str(HERE / "readers.py"), "dpkt", str(file)),
            not_found("dpkt" if library["dpkt"] else None, "dpkt"),
            printed_number,
            whole_headers,
            slow=True,
        ),
        Tool(
            "tshark -q, records only",
            lambda file: ["tshark", "-n", "-q", "-r", str(file)],
            not_found(tshark, "tshark"),
            slow=True,
        ),
        Tool(
            "tshark, one line per frame",
            lambda file: ["tshark", "-n", "-r", str(file)],
            not_found(tshark, "tshark"),
            slow=True,
        ),
        Tool(
            "tshark with Lua, 4 fields",
            lambda file: ["tshark", "-n", *lua, "-r", str(file), "-T", "fields", *four_fields],
            not_found(tshark, "tshark"),
            filled_lines,
            whole_headers,
            slow=True,
        ),
        Tool(
            "Scapy loop",
            lambda file: python(str(HERE / "readers.py"), "scapy", str(file), "--limit", str(SCAPY_FRAMES)),
            not_found("scapy" if library["scapy"] else None, "Scapy"),
            frames=SCAPY_FRAMES,
        ),
    ]


def measure(command: list[str], core: int, output: Path | None = None) -> Run:
    """Run one process pinned to one core; raises ProcessError where it does not end well.

    nvscope's exit code 3 (data loss found) is a success.
    """
    with (
        open(output or os.devnull, "wb") as out,
        tempfile.TemporaryFile() as errors,
    ):
        # A process inherits the cores of the thread that starts it.
        elsewhere = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {core})
        started = time.perf_counter()
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=errors,
            # As a person has it: with Python's modules compiled once, whatever is set where this runs.
            env={name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"},
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
    """Watches the anonymous memory of a process, which leaves out the pages of mapped files."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.peak_bytes = 0
        self._status = f"/proc/{pid}/status"
        self._ended = threading.Event()

    def run(self) -> None:
        while not self._ended.wait(SAMPLE_SECONDS):
            try:
                with open(self._status) as status:
                    lines = [line for line in status if line.startswith("RssAnon:")]
            except OSError:
                return
            if lines:
                self.peak_bytes = max(self.peak_bytes, int(lines[0].split()[1]) * 1024)

    def stop(self) -> None:
        self._ended.set()
        self.join()


def compare(file: Path, truth: dict[str, Any], chosen: list[Tool], *, runs: int, core: int, fast: bool) -> list[Row]:
    """Run every tool once to warm up and to see that it sees all telegrams, then ``runs`` times in turn."""
    rows = [Row(tool) for tool in chosen]
    for row in rows:
        if row.tool.missing:
            row.note = row.tool.missing
        elif fast and row.tool.slow and truth["telegrams"] > FAST_LIMIT:
            row.note = "skipped"
        else:
            warm_up(row, file, truth, core)
    for turn in range(runs):
        for row in rows:
            if not row.note:
                progress(f"{truth['telegrams']:,} telegrams, run {turn + 1} of {runs}: {row.tool.name}")
                try:
                    row.runs.append(measure(row.tool.command(file), core))
                except (ProcessError, OSError) as error:
                    row.note = f"left out: {error}"
    for row in rows:
        if not row.note:
            row.wall_s, row.cpu_s = row.median("wall_s"), row.median("cpu_s")
            if row.tool.frames is not None and row.tool.frames < truth["frames"]:
                extrapolate(row, file, truth, runs, core)
    progress("")
    return rows


def warm_up(row: Row, file: Path, truth: dict[str, Any], core: int) -> None:
    progress(f"{truth['telegrams']:,} telegrams, warm-up: {row.tool.name}")
    output = file.with_suffix(".output")
    try:
        measure(row.tool.command(file), core, output)
        row.seen = row.tool.seen(output)
        expected = row.tool.expected(truth)
        if row.seen != expected:
            row.note = f"saw {row.seen} telegrams instead of {expected}"
    except (ProcessError, OSError, ValueError, KeyError) as error:
        row.note = f"left out: {error}"
    finally:
        output.unlink(missing_ok=True)


def extrapolate(row: Row, file: Path, truth: dict[str, Any], runs: int, core: int) -> None:
    """Scale a part of the file up to the whole, without counting the start of the program more than once."""
    assert row.tool.frames is not None
    assert row.wall_s is not None
    assert row.cpu_s is not None
    empty = [measure([*row.tool.command(file)[:-1], "0"], core) for _ in range(runs)]
    scale = truth["frames"] / row.tool.frames
    start_wall_s, start_cpu_s = median(empty, "wall_s"), median(empty, "cpu_s")
    row.wall_s = start_wall_s + (row.wall_s - start_wall_s) * scale
    row.cpu_s = start_cpu_s + (row.cpu_s - start_cpu_s) * scale
    row.note = f"extrapolated from {row.tool.frames:,} frames; memory is that of this part"


def borrow(rows: list[Row], smaller: list[Row], scale: float) -> None:
    """Fill skipped rows with the figures of a smaller capture, scaled."""
    for row, source in zip(rows, smaller, strict=True):
        if row.note == "skipped" and source.wall_s is not None and source.cpu_s is not None:
            row.wall_s, row.cpu_s = source.wall_s * scale, source.cpu_s * scale
            row.note = "not run: the rate of the smaller capture"


def print_comparison(rows: list[Row], truth: dict[str, Any]) -> None:
    print(
        f"\n{truth['telegrams']:,} telegrams, {truth['frames']:,} frames, {truth['bytes'] / 1e6:,.1f} MB, "
        f"{truth['lists']} lists, {truth['nodes']} nodes, {truth['streams']} streams"
    )
    print(
        f"{'':33}{'wall s':>9}{'cpu s':>9}{'telegrams/s':>13}{'/ nvscope':>11}{'by cpu':>9}{'RSS MB':>8}{'anon MB':>9}"
    )
    ours = rows[0] if rows[0].wall_s is not None else None
    for row in rows:
        if row.wall_s is None or row.cpu_s is None:
            print(f"{row.tool.name:33}{row.note}")
            continue
        ratio, cpu_ratio = "–", "–"
        if ours is not None and ours.wall_s and ours.cpu_s:
            ratio, cpu_ratio = f"{row.wall_s / ours.wall_s:.2f}", f"{row.cpu_s / ours.cpu_s:.2f}"
        memory = f"{'–':>8}{'–':>9}"
        if row.runs:
            memory = f"{row.median('rss_bytes') / MIB:>8.0f}{row.median('anonymous_bytes') / MIB:>9.0f}"
        print(
            f"{row.tool.name:33}{row.wall_s:>9.3f}{row.cpu_s:>9.3f}{truth['telegrams'] / row.wall_s:>13,.0f}"
            f"{ratio:>11}{cpu_ratio:>9}{memory}{'  ' + row.note if row.note else ''}"
        )


def print_growth(tables: list[tuple[dict[str, Any], list[Row]]]) -> None:
    small, large = tables[0], tables[-1]
    scale = large[0]["telegrams"] / small[0]["telegrams"]
    print(f"\nGrowth with {scale:g} times the telegrams (linear: {scale:g}; memory that does not grow: 1)")
    print(f"{'':33}{'wall':>9}{'cpu':>9}{'RSS':>9}{'anon':>9}")
    for before, after in zip(small[1], large[1], strict=True):
        if before.runs and after.runs and before.tool.frames is None:
            print(f"{before.tool.name:33}", end="")
            for figure in ("wall_s", "cpu_s", "rss_bytes", "anonymous_bytes"):
                start = before.median(figure)
                print(f"{after.median(figure) / start:>9.2f}" if start else f"{'–':>9}", end="")
            print()


def print_start_up(file: Path, runs: int, core: int) -> None:
    nvscope = nvscope_path()
    commands = {"python -c pass": python("-c", "pass")}
    if nvscope:
        commands["nvscope --help"] = [nvscope, "--help"]
        commands["nvscope report, 500 frames"] = [nvscope, "report", str(file)]
        commands["nvscope report --json, 500 frames"] = [nvscope, "report", "--json", str(file)]
    print(f"\nStart-up, median of {runs} runs\n{'':35}{'wall s':>9}{'cpu s':>9}{'RSS MB':>8}")
    for name, command in commands.items():
        try:
            measure(command, core)
            measured = [measure(command, core) for _ in range(runs)]
        except (ProcessError, OSError) as error:
            print(f"{name:35}left out: {error}")
            continue
        wall, cpu, rss = (median(measured, figure) for figure in ("wall_s", "cpu_s", "rss_bytes"))
        print(f"{name:35}{wall:>9.3f}{cpu:>9.3f}{rss / MIB:>8.0f}")
    if not nvscope:
        print("nvscope is not installed")


def generate(folder: Path, telegrams: int, seed: int, kind: str) -> tuple[Path, dict[str, Any]]:
    """Have the capture written by a process of its own; return it with what it holds."""
    progress(f"generating {telegrams:,} telegrams")
    command = python(
        str(HERE / "generate.py"), "--telegrams", str(telegrams), "--seed", str(seed), "--kind", kind, "--dir",
        str(folder),
    )  # fmt: skip
    path = Path(subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip())
    progress("")
    return path, json.loads(path.with_suffix(".json").read_text())


def progress(text: str) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")
        sys.stderr.flush()


def version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


def machine() -> str:
    processor = platform.processor() or platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            processor = line.split(":", 1)[1].strip()
            break
    tshark = "missing"
    if shutil.which("tshark"):
        tshark = subprocess.run(["tshark", "--version"], capture_output=True, text=True, check=False).stdout.split(
            "\n"
        )[0]
    packages = ", ".join(f"{name} {version(name)}" for name in ("nvscope", "numpy", "dpkt", "scapy"))
    return f"{processor}, {os.cpu_count()} cores; Python {platform.python_version()}; {packages}; {tshark}"


def reserve_core() -> int:
    """Choose the core for the measured processes and leave it, where there is another one."""
    available = sorted(os.sched_getaffinity(0))
    if len(available) > 1:
        os.sched_setaffinity(0, set(available[:-1]))
    return available[-1]


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare nvscope with other ways to read the same capture.")
    parser.add_argument("--telegrams", type=int, nargs="+", default=[1_000_000], help="sizes of the captures")
    parser.add_argument("--runs", type=int, default=3, help="timed runs of each tool; the median is shown")
    parser.add_argument("--start-up-runs", type=int, default=11)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, default=KINDS[0], help="how the lists of the plant are sent")
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="only tools whose name contains one of these words")
    parser.add_argument(
        "--fast", action="store_true", help="above 1 M telegrams, take the slow tools' rate from the smaller capture"
    )
    arguments = parser.parse_args()
    sizes = sorted(set(arguments.telegrams))
    if arguments.fast and sizes[0] > FAST_LIMIT:
        parser.error(f"--fast needs a capture of at most {FAST_LIMIT:,} telegrams among --telegrams")

    core = reserve_core()
    chosen = [
        tool
        for number, tool in enumerate(tools())
        if number == 0 or not arguments.only or any(word in tool.name for word in arguments.only)
    ]
    print(machine())
    print(f"Whole processes on core {core}, median of {arguments.runs} runs in turn after one warm-up, file in cache.")
    tables: list[tuple[dict[str, Any], list[Row]]] = []
    for size in sizes:
        file, truth = generate(arguments.dir, size, arguments.seed, arguments.kind)
        rows = compare(file, truth, chosen, runs=arguments.runs, core=core, fast=arguments.fast)
        if tables:
            borrow(rows, tables[-1][1], truth["telegrams"] / tables[-1][0]["telegrams"])
        print_comparison(rows, truth)
        tables.append((truth, rows))
    if len(tables) > 1:
        print_growth(tables)
    file, _ = generate(arguments.dir, START_UP_TELEGRAMS, arguments.seed, arguments.kind)
    print_start_up(file, arguments.start_up_runs, core)


if __name__ == "__main__":
    main()
