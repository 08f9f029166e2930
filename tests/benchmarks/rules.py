"""Measure rules: how long 200 of them take beside a report on the same capture, and what memory they need.

    python tests/benchmarks/rules.py                                     four plants of a million telegrams
    python tests/benchmarks/rules.py --kind cyclic --telegrams 10000000
    python tests/benchmarks/rules.py --mixed                             rules of sixteen kinds
    python tests/benchmarks/rules.py --variables                         rules about values, of lists with definitions

Prints a table, asserts nothing about time. What the columns mean is in README.md beside this file.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
from pathlib import Path

from machine import machine
from measurement import Run, measure
from recording import KINDS, defined
from recording import LISTS as DEFINED
from run import generate
from tool import nvscope_path

LISTS = 50
OF_LISTS = (
    'check = "cycle"\ninterval = "50ms"\ntolerance = "2000%"\nexceptions = "100%"',
    'check = "loss"\nmax = "50%"',
    'check = "silence"\nmax = "1h"',
    'check = "single_sender"',
)
MIXED = (
    *OF_LISTS, 'check = "jitter"\nmax = "10s"', 'check = "min_gap"\nmin = "1us"', 'check = "present"',
    'check = "occurrence"\nper = "10s"\nmin = 0', 'check = "gap"\nmax = 100000', 'check = "restarts"\nmax = 100',
    'check = "never"\nexpr = "list.lost > 100000"\nwindow = "1s"', 'check = "always"\nexpr = "nv.length > 10"',
    'check = "never"\nexpr = "nv.items > 100"\nfor = "1s"', 'check = "acknowledged"\nmin = "0%"',
    'check = "coherence"\nmax = "100%"', 'check = "duplicates"\nmax = 100000',
)  # fmt: skip
OF_VARIABLES = (
    'check = "range"\nvariable = "l{number}.w[{again}]"\nmin = 0',
    'check = "frozen"\nvariable = "l{number}.w[{again}]"\nmax = "1h"',
    'check = "always"\nexpr = "var.l{number}.w[{again}] >= 0"',
    'check = "implies"\nif = "var.l{number}.b[{again}] == 7"\nthen = "var.l{number}.b[{again}] > 0"\nwithin = "1s"',
)


def rules(folder: Path, warmup: str, *, mixed: bool) -> Path:
    """Write 200 rules, four for each of fifty lists; of four kinds, or of all that are about lists."""
    path, kinds = folder / "benchmark.rules.toml", MIXED if mixed else OF_LISTS
    texts = [f'[defaults]\nwarmup = "{warmup}"\n']
    texts += [
        f'[[rule]]\nid = "r{number}"\nlist = {number // 4 + 1}\nseverity = "note"\n{kinds[number % len(kinds)]}\n'
        for number in range(4 * LISTS)
    ]
    path.write_text("\n".join(texts))
    return path


def filled(text: str, number: int, again: int) -> str:
    return text.replace("{number}", str(number)).replace("{again}", str(again))


def of_variables(folder: Path, lists: int) -> Path:
    """Write 200 rules about the variables of some lists."""
    path = folder / "variables.rules.toml"
    each = 200 // (lists * len(OF_VARIABLES))
    path.write_text("\n".join(
        f'[[rule]]\nid = "{number}-{place}-{again}"\nseverity = "note"\n{filled(text, number, again)}\n'
        for number in range(1, lists + 1) for place, text in enumerate(OF_VARIABLES) for again in range(each)
    ))  # fmt: skip
    return path


def compare(name: str, file: Path, options: list[str], rule_file: Path, runs: int) -> None:
    """Print how long rules take beside a report, in pairs that follow each other, and the memory of both."""
    nvscope, core = str(nvscope_path()), max(os.sched_getaffinity(0))
    pairs: list[tuple[Run, Run]] = []
    for _ in range(runs + 1):
        report = measure([nvscope, "report", "--json", "-q", str(file), *options], core)
        words = ["check", "--json", "-q", "--fail-on", "never", str(file), "--rules", str(rule_file), *options]
        pairs.append((report, measure([nvscope, *words], core)))
    # The first pair brings the file into memory.
    pairs = pairs[1:] if runs else pairs
    ratios = [check.cpu_s / report.cpu_s for report, check in pairs]
    reports, checks = ([pair[place].cpu_s for pair in pairs] for place in (0, 1))
    memory = [max(pair[place].anonymous_bytes for pair in pairs) / 1e6 for place in (0, 1)]
    print(
        f"{name:34} {statistics.median(reports):8.2f} {statistics.median(checks):8.2f} "
        f"{statistics.median(ratios):6.2f} ({min(ratios):.2f}–{max(ratios):.2f}) {memory[0]:9.0f} {memory[1]:9.0f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure 200 rules.")
    parser.add_argument("--telegrams", type=int, nargs="+", default=[1_000_000])
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=KINDS)
    parser.add_argument("--warmup", default="0s", help="what is left out at the beginning")
    parser.add_argument("--variables", action="store_true", help="rules about values instead")
    parser.add_argument("--mixed", action="store_true", help="rules of sixteen kinds, not of four")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    arguments = parser.parse_args()
    arguments.dir.mkdir(exist_ok=True)
    print(machine())
    print(f"\n{'':34} {'report s':>8} {'check s':>8} {'ratio':>6} {'':11} {'report MB':>9} {'check MB':>9}")
    for telegrams in sorted(arguments.telegrams):
        if arguments.variables:
            file, definitions = defined(arguments.dir, telegrams // (DEFINED * 100))
            rule_file = of_variables(arguments.dir, DEFINED)
            compare(f"values, {telegrams:,}", file, ["--gvl", str(definitions)], rule_file, arguments.runs)
            continue
        for kind in arguments.kind:
            file, _ = generate(arguments.dir, telegrams, arguments.seed, kind)
            rule_file = rules(arguments.dir, arguments.warmup, mixed=arguments.mixed)
            compare(f"{kind}, {telegrams:,}", file, [], rule_file, arguments.runs)


if __name__ == "__main__":
    main()
