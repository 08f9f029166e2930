"""Plots: numbers over time as lines of characters, with a scale of values at the left and one of times below.

A character of the drawing is two dots wide and four dots high. Whatever the numbers and the size are, nothing raises;
what is no finite number is left out, and nothing is drawn over it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from msgspec import Struct, field

from dissectors.batch import I64, Bool
from nvscope.view.lines.scales import Tick, nice_ticks, time_ticks
from nvscope.view.lines.table import Cell, Line, Tone
from nvscope.view.lines.text_width import display_width, head

F64 = npt.NDArray[np.float64]

_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
_BRAILLE = 0x2800
_WIDE, _HIGH = 2, 4
_LEAST_CELLS = 8
_LEAST_HEIGHT = 3
"""From so many lines on, the last one is the scale of times."""

_LONGEST_LABEL = 16


class Curve(Struct, frozen=True):
    """Numbers and their times, in the order in which they came; those of one ``run`` that follow each other are joined.

    All are of shape (n,).
    """

    time_ns: I64
    value: F64
    run: I64


class Axes(Struct, frozen=True):
    """From when to when a plot is, and how its scales are told.

    ``time_text`` writes a time with so many digits of the second. ``value_text`` writes a value, None for plain
    numbers; ``whole``: there are none between whole ones. ``levels`` are names of values, which take the place of
    rounded ones at the scale. ``least`` and ``most`` are values that are in view in any case. ``stepped``: a value
    stays until the next one comes.
    """

    start_ns: int
    end_ns: int
    time_text: Callable[[int, int], str]
    value_text: Callable[[float], str] | None = None
    levels: Mapping[float, str] = field(default_factory=lambda: MappingProxyType({}))
    least: float | None = None
    most: float | None = None
    whole: bool = False
    stepped: bool = False

    @property
    def length_ns(self) -> int:
        return max(self.end_ns - self.start_ns, 1)


class Plotted(NamedTuple):
    """Lines of a plot, and how many characters wide the drawing in it is."""

    lines: list[Line]
    cells: int


def plot(curve: Curve, axes: Axes, width: int, height: int, cursor_ns: int | None = None) -> Plotted:
    """Return exactly ``height`` lines of at most ``width`` columns; both are at least 1.

    Where there is no room for scales, they are left out. ``cursor_ns`` is a time at which a vertical line stands.
    """
    rows = height - 1 if height >= _LEAST_HEIGHT else height
    shown = np.isfinite(curve.value) & (curve.time_ns >= axes.start_ns) & (curve.time_ns <= axes.end_ns)
    low, high = _bounds(curve.value[shown], axes)
    labels = _labels(low, high, rows, axes) if shown.any() or axes.levels else {}
    label_width = max((display_width(text) for text in labels.values()), default=0)
    margin = label_width + 2 if width >= label_width + 2 + _LEAST_CELLS else 0
    cells = width - margin
    drawn = _texts(_grid(curve, shown, axes, low, high, rows * _HIGH, cells * _WIDE))
    at = None if cursor_ns is None else cell_of(cursor_ns, axes, cells)
    lines: list[Line] = [
        [*_scale(labels.get(row), label_width, margin), *_row(text, at)]
        for row, text in enumerate(drawn)
    ]  # fmt: skip
    if rows < height:
        ticks = time_ticks(axes.start_ns, axes.end_ns, cells, axes.time_text)
        lines.append([Cell(" " * margin), Cell(_times(ticks, axes, cells), Tone.FAINT)])
    return Plotted(lines, cells)


def cell_of(time_ns: int, axes: Axes, cells: int) -> int | None:
    """Return in which character of a drawing a time is, None where it is not in view."""
    if not axes.start_ns <= time_ns <= axes.end_ns:
        return None
    return min((time_ns - axes.start_ns) * cells // axes.length_ns, cells - 1)


def _bounds(value: F64, axes: Axes) -> tuple[float, float]:
    """Return the least and the greatest value in view, which differ."""
    known = [float(value.min()), float(value.max())] if len(value) else []
    known += [one for one in (axes.least, axes.most) if one is not None]
    low, high = (min(known), max(known)) if known else (0.0, 1.0)
    if low < high:
        return low, high
    numbers = np.finfo(np.float64)
    most = float(numbers.max)
    # A tenth of the least numbers there are is nothing.
    more = max(abs(low) * 0.1, 1.0 if axes.whole or not low else float(numbers.tiny))
    return max(low - more, -most), min(high + more, most)


def _labels(low: float, high: float, rows: int, axes: Axes) -> dict[int, str]:
    """Return what stands beside which row of characters."""
    if axes.levels:
        ticks = [Tick(value, name) for value, name in sorted(axes.levels.items()) if low <= value <= high]
    else:
        ticks = nice_ticks(low, high, max((rows + 1) // 2, 2), whole=axes.whole, text=axes.value_text)
    found: dict[int, str] = {}
    for value, text in ticks:
        dot = int(_share(np.array([value]), low, high)[0] * (rows * _HIGH - 1) + 0.5)
        told = text if display_width(text) <= _LONGEST_LABEL else f"{head(text, _LONGEST_LABEL - 1)}…"
        found.setdefault(rows - 1 - dot // _HIGH, told)
    return found


def _share(value: F64, low: float, high: float) -> F64:
    """Return where values lie between two others, from 0 to 1."""
    length = high - low
    if np.isfinite(length):
        share: F64 = (value - low) / length
    else:  # the whole range of numbers
        share = (value / 2 - low / 2) / (high / 2 - low / 2)
    return share.clip(0, 1)


def _grid(curve: Curve, shown: Bool, axes: Axes, low: float, high: float, rows: int, columns: int) -> Bool:
    """Return which dots are drawn, the lowest row first, as (rows, columns)."""
    depth = np.zeros((rows + 1, columns), np.int64)
    if not shown.any():
        return depth[:-1] > 0
    with np.errstate(over="ignore"):
        y = np.rint(_share(curve.value[shown], low, high) * (rows - 1)).astype(np.int64)
    passed = (curve.time_ns[shown] - axes.start_ns).astype(np.float64) / axes.length_ns
    x = (passed * columns).astype(np.int64).clip(0, columns - 1)
    # What is left out in between parts what is around it.
    left_out = np.cumsum(~shown)[shown]
    run = curve.run[shown]
    if (x[1:] < x[:-1]).any():  # a clock was set back
        order = np.argsort(x, kind="stable")
        x, y, left_out, run = x[order], y[order], left_out[order], run[order]
    first = np.flatnonzero(np.append(True, x[1:] != x[:-1]))
    last = np.append(first[1:], len(x)) - 1
    at = x[first]
    spans = [(at, np.minimum.reduceat(y, first), np.maximum.reduceat(y, first))]
    joined = np.flatnonzero((run[last[:-1]] == run[first[1:]]) & (left_out[last[:-1]] == left_out[first[1:]]))
    between = _steps if axes.stepped else _slopes
    for number in joined.tolist():
        begin, end = int(last[number]), int(first[number + 1])
        spans.append(between(int(at[number]), int(at[number + 1]), int(y[begin]), int(y[end])))
    column, lowest, highest = (np.concatenate(part) for part in zip(*spans, strict=True))
    np.add.at(depth, (lowest, column), 1)
    np.add.at(depth, (highest + 1, column), -1)
    return np.cumsum(depth, axis=0)[:-1] > 0


_Spans = tuple[I64, I64, I64]
"""Columns, and from which row to which dots are drawn in each."""


def _steps(left: int, right: int, before: int, after: int) -> _Spans:
    column = np.arange(left, right + 1)
    lowest, highest = np.full(len(column), before), np.full(len(column), before)
    lowest[-1], highest[-1] = min(before, after), max(before, after)
    return column, lowest, highest


def _slopes(left: int, right: int, before: int, after: int) -> _Spans:
    row = np.rint(np.linspace(before, after, right - left + 1)).astype(np.int64)
    way = np.sign(row[1:] - row[:-1])
    # Each column goes on where the one before it ended, so that nothing is left open.
    begin, end = np.where(way == 0, row[1:], row[:-1] + way), row[1:]
    return np.arange(left + 1, right + 1), np.minimum(begin, end), np.maximum(begin, end)


def _texts(grid: Bool) -> list[str]:
    """Return rows of characters, the highest first."""
    rows, columns = grid.shape
    dots = grid[::-1].reshape(rows // _HIGH, _HIGH, columns // _WIDE, _WIDE)
    codes = (dots * _DOTS[np.newaxis, :, np.newaxis, :]).sum(axis=(1, 3))
    return ["".join(chr(_BRAILLE + code) if code else " " for code in row) for row in codes.tolist()]


def _scale(label: str | None, label_width: int, margin: int) -> list[Cell]:
    if not margin:
        return []
    text = label or ""
    return [Cell(f"{' ' * (label_width - display_width(text))}{text} {'│' if label is None else '┤'}", Tone.FAINT)]


def _row(text: str, cursor: int | None) -> list[Cell]:
    if cursor is None:
        return [Cell(text, Tone.NOTE)]
    at = text[cursor]
    parts = [Cell(text[:cursor], Tone.NOTE), Cell("│" if at == " " else at, Tone.WARNING)]
    return [cell for cell in (*parts, Cell(text[cursor + 1 :], Tone.NOTE)) if cell.text]


def _times(ticks: Sequence[Tick], axes: Axes, cells: int) -> str:
    line = ""
    for value, text in ticks:
        place = cell_of(int(value), axes, cells)
        told = f"╵{text}"
        if place is not None and (place > len(line) or not line) and place + len(told) <= cells:
            line = line.ljust(place) + told
    return line
