"""Tools run in turn on the same capture, each in a process of its own."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from measurement import ProcessError, Run, measure, median
from tool import Tool

FAST_LIMIT = 1_000_000


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


def progress(text: str) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")
        sys.stderr.flush()
