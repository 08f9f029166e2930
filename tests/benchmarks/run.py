"""Compare ``nvscope report --json`` with other ways to read the same capture, as whole processes on one core.

    python tests/benchmarks/run.py                                    1 M telegrams
    python tests/benchmarks/run.py --telegrams 1000000 10000000       and 10 M, with the growth from one to the other

Prints tables, asserts nothing about time. What the columns mean is in README.md beside this file. Needs Linux.
This process stays small on purpose (no numpy): the kernel counts the memory of the process that starts another one
into the other one's peak.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from comparison import FAST_LIMIT, Row, borrow, compare, progress
from machine import machine, reserve_core
from measurement import ProcessError, measure, median
from tables import MIB, print_comparison, print_growth
from tool import HERE, Tool, not_found, nvscope_path, printed_number, python

LUA_DISSECTOR = HERE / "dissector.lua"
LUA_FIELDS = ("nv.index", "nv.subindex", "nv.counter", "nv.flags")
SCAPY_FRAMES = 20_000
START_UP_TELEGRAMS = 495  # and one frame in a hundred of other traffic: 500 frames
KINDS = ("cyclic", "events", "many", "large", "steady")  # as in generate.py, which needs numpy


def whole_headers(truth: dict[str, Any]) -> int:
    return int(truth["telegrams"] - truth["kinds"]["short"])


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
