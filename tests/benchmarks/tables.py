"""Comparisons, and growth from one size to another, as tables."""

from __future__ import annotations

from typing import Any

from comparison import Row

MIB = 1 << 20


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
