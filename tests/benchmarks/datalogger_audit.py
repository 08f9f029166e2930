"""Measure `nvscope audit`: databases as a DataLogger writes them, beside a loop over the rows that sqlite3 hands out.

    python tests/benchmarks/datalogger_audit.py                        1 M rows of 18 variables with counters
    python tests/benchmarks/datalogger_audit.py --rows 10000000        time and memory: the same by row, the same
    python tests/benchmarks/datalogger_audit.py --variables 100
    python tests/benchmarks/datalogger_audit.py --kind every           storeChangesOnly is false

The loop looks at nothing: it is what any audit that has SQLite hand out values takes. Prints a table, asserts nothing
about time. What the columns mean is in README.md beside this file.
"""

from __future__ import annotations

import argparse
import os
import random
import sqlite3
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime, timedelta
from pathlib import Path

from machine import machine
from measurement import Run, measure, median
from pairs import print_ratio
from tool import nvscope_path

from dissectors.datalogger.tables import LoggedVariable, LogTable, statement

_CHANGING = 2, 6
"""Of 18 variables, so many have another value in a row: in a table of changes, and in one of every value."""
_MOST_LOOP_ROWS = 1_000_000
_LOOP = (
    "import sqlite3, sys\nfor _ in sqlite3.connect(sys.argv[1]).execute(f'SELECT rowid, * FROM {sys.argv[2]}'): pass"
)


def table(variables: int, kind: str) -> LogTable:
    """Return the table of a benchmark."""
    step = 2 if kind == "changes" else 1
    columns = [
        LoggedVariable(
            f"Arp.Plc.Eclr/V{number:03}", "SMALLINT", 2 + step * number, 3 + step * number if step == 2 else None
        )
        for number in range(variables)
    ]
    return LogTable("log_changes_1" if step == 2 else "log_1", False, tuple(columns))


def rows_of(count: int, variables: int, kind: str) -> Iterator[tuple[object, ...]]:
    """Yield rows every 250 ms."""
    chance, start = random.Random(1), datetime(2020, 4, 13)
    values, counts = [0] * variables, [0] * variables
    changing = max(1, _CHANGING[kind == "every"] * variables // 18)
    for number in range(count):
        stamp = (start + timedelta(milliseconds=250 * number)).isoformat(timespec="microseconds")
        chosen = range(variables) if not number else chance.sample(range(variables), changing)
        cells: list[object] = [None] * (2 * variables)
        for place in chosen:
            counts[place] += number > 0
            values[place] = (values[place] + chance.randint(1, 9)) % 30_000
            cells[2 * place : 2 * place + 2] = values[place], counts[place]
        yield (stamp, 1, *(values if kind == "every" else cells))


def generate(path: Path, count: int, variables: int, kind: str) -> None:
    """Write the database, without what SQLite does against a loss of power."""
    log = table(variables, kind)
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        for pragma in ("auto_vacuum = 1", "journal_mode = OFF", "synchronous = OFF"):
            database.execute(f"PRAGMA {pragma}")
        database.execute("BEGIN")
        database.execute(statement(log))
        marks = ", ".join("?" * log.columns)
        database.executemany(f"INSERT INTO {log.name} VALUES ({marks})", rows_of(count, variables, kind))
        database.execute("COMMIT")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--variables", type=int, default=18)
    parser.add_argument("--kind", choices=("changes", "every"), default="changes")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--dir", type=Path, default=Path(tempfile.gettempdir()) / "nvscope-benchmarks")
    told = parser.parse_args()
    print(machine())
    told.dir.mkdir(exist_ok=True)
    path = told.dir / f"datalogger-{told.kind}-{told.variables}-{told.rows}.db"
    if not path.exists():
        generate(path, told.rows, told.variables, told.kind)
    core = max(os.sched_getaffinity(0))
    tools = {"nvscope": [str(nvscope_path()), "audit", "--json", "-q", str(path)]}
    if told.rows <= _MOST_LOOP_ROWS:
        tools["sqlite3"] = [sys.executable, "-c", _LOOP, str(path), table(told.variables, told.kind).name]
    runs: dict[str, list[Run]] = {name: [] for name in tools}
    for number in range(told.runs + 1):
        for name, command in tools.items():
            run = measure(command, core)
            if number:
                runs[name].append(run)
    print(f"\n{told.rows} rows of {told.variables} variables, {told.kind}, {path.stat().st_size / 1e6:.0f} MB\n")
    print(f"{'':10} {'cpu s':>8} {'rows/s':>10} {'RSS MB':>8} {'anon MB':>8}")
    for name, own in runs.items():
        cpu_s, rss, anonymous = (median(own, which) for which in ("cpu_s", "rss_bytes", "anonymous_bytes"))
        print(f"{name:10} {cpu_s:8.2f} {told.rows / cpu_s:10.0f} {rss / 1e6:8.0f} {anonymous / 1e6:8.0f}")
    if "sqlite3" in runs:
        print_ratio(list(zip(runs["nvscope"], runs["sqlite3"], strict=True)))


if __name__ == "__main__":
    main()
