"""Compare ``nvscope export`` with other ways to decode every variable of a capture, as whole processes on one core.

    python tests/benchmarks/export.py                                    1 M telegrams
    python tests/benchmarks/export.py --telegrams 1000000 10000000       and 10 M, with the growth from one to the other
    python tests/benchmarks/export.py --node DIRECTORY                   where node-red-contrib-nvl is installed there

What is measured, and how, is in README.md beside this file. Prints tables, asserts nothing about time. Needs Linux.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from comparison import Row, borrow, compare, progress
from machine import machine, reserve_core
from tables import print_comparison, print_growth
from tool import HERE, Tool, not_found, nvscope_path, printed_number, python


def well_formed(truth: dict[str, Any]) -> int:
    return int(truth["well_formed"])


def tools(definitions: list[str], output: Path, modules: Path | None) -> list[Tool]:
    nvscope, node = nvscope_path(), shutil.which("node")
    gvl = [word for file in definitions for word in ("--gvl", file)]

    def export(name: str, *options: str) -> Tool:
        return Tool(
            name,
            lambda file: [str(nvscope), "export", "-q", str(file), *gvl, *options],
            not_found(nvscope, "nvscope"),
            slow="csv" in options[-1],
        )

    plain = str(HERE / "plain_values.py")
    receiver = modules and modules / "node_modules" / "node-red-contrib-nvl"
    missing = not_found(node, "node") or not_found(str(receiver) if receiver and receiver.exists() else None, "it")
    return [
        export("nvscope export, Parquet", "-w", str(output / "values.parquet")),
        Tool("cksum (floor)", lambda file: ["cksum", str(file)], not_found(shutil.which("cksum"), "cksum")),
        Tool(
            "Python, struct, nothing written",
            lambda file: python(plain, str(file), "-", *definitions),
            None,
            printed_number,
            well_formed,
            slow=True,
        ),
        Tool(
            "Python, struct and csv",
            lambda file: python(plain, str(file), str(output), *definitions),
            None,
            printed_number,
            well_formed,
            slow=True,
        ),
        Tool(
            "node-red-contrib-nvl, not written",
            lambda file: ["env", f"NODE_PATH={modules}/node_modules", str(node), str(HERE / "node_red.js"), str(file),
                          *definitions],
            missing,
            printed_number,
            well_formed,
            slow=True,
        ),
        export("nvscope export, CSV", "-w", str(output / "values.csv")),
    ]  # fmt: skip


def generate(folder: Path, telegrams: int, seed: int) -> tuple[Path, dict[str, Any]]:
    """Have the capture written by a process of its own; return it with what it holds."""
    progress(f"generating {telegrams:,} telegrams")
    command = python(str(HERE / "values.py"), "--telegrams", str(telegrams), "--seed", str(seed), "--dir", str(folder))
    path = Path(subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip())
    progress("")
    truth = json.loads(path.with_suffix(".json").read_text())
    return path, {**truth, "nodes": 10, "streams": truth["lists"]}


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare ways to decode every variable of a capture.")
    parser.add_argument("--telegrams", type=int, nargs="+", default=[1_000_000], help="sizes of the captures")
    parser.add_argument("--runs", type=int, default=3, help="timed runs of each tool; the median is shown")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    parser.add_argument("--node", type=Path, help="where `npm install node-red-contrib-nvl` was run")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="only tools whose name contains one of these words")
    arguments = parser.parse_args()
    core = reserve_core()
    print(machine())
    print(f"Whole processes on core {core}, median of {arguments.runs} runs in turn after one warm-up, file in cache.")
    tables: list[tuple[dict[str, Any], list[Row]]] = []
    os.environ["POLARS_MAX_THREADS"] = "1"
    for size in sorted(set(arguments.telegrams)):
        file, truth = generate(arguments.dir, size, arguments.seed)
        output = arguments.dir / "exported"
        output.mkdir(exist_ok=True)
        chosen = [
            tool
            for number, tool in enumerate(tools(truth["definitions"], output, arguments.node))
            if number == 0 or not arguments.only or any(word in tool.name for word in arguments.only)
        ]
        rows = compare(file, truth, chosen, runs=arguments.runs, core=core, fast=bool(tables))
        if tables:
            borrow(rows, tables[-1][1], truth["telegrams"] / tables[-1][0]["telegrams"])
        print_comparison(rows, truth)
        written = sum(path.stat().st_size for path in output.glob("*.parquet"))
        print(
            f"{truth['values']:,} values of {truth['well_formed']:,} telegrams; Parquet files {written / 1e6:,.1f} MB"
        )
        tables.append((truth, rows))
        shutil.rmtree(output)
    if len(tables) > 1:
        print_growth(tables)


if __name__ == "__main__":
    main()
