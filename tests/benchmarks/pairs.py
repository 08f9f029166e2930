"""Pairs of runs, of nvscope and of what stands beside it, as a table and a ratio."""

from __future__ import annotations

from collections.abc import Sequence

from measurement import Run, median


def print_pairs(other: str, pairs: Sequence[tuple[Run, Run]], items: int) -> None:
    """Print the medians of both sides, those of each of ``items`` pieces of work too, and the ratio."""
    print(f"{'':12} {'wall s':>8} {'cpu s':>8} {'µs each':>8} {'RSS MB':>8} {'anon MB':>8}")
    for name, place in (("nvscope", 0), (other, 1)):
        runs = [pair[place] for pair in pairs]
        names = "wall_s", "cpu_s", "rss_bytes", "anonymous_bytes"
        wall_s, cpu_s, rss, anonymous = (median(runs, which) for which in names)
        each = 1e6 * cpu_s / items
        print(f"{name:12} {wall_s:8.2f} {cpu_s:8.2f} {each:8.2f} {rss / 1e6:8.0f} {anonymous / 1e6:8.0f}")
    print_ratio(pairs)


def print_ratio(pairs: Sequence[tuple[Run, Run]]) -> None:
    """Print how many times nvscope's time the other side needs: the median of pairs, least and most."""
    print()
    for words, name in (("by the clock", "wall_s"), ("by cpu", "cpu_s")):
        ratios = sorted(getattr(theirs, name) / getattr(ours, name) for ours, theirs in pairs)
        print(f"{words}, in pairs: {ratios[len(ratios) // 2]:.1f} ({ratios[0]:.1f} to {ratios[-1]:.1f})")
