"""Plots: whatever is to be drawn, what is drawn says it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nvscope import units
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Enumeration
from nvscope.view.lines.plot import Axes, Curve, cell_of, plot
from nvscope.view.lines.scales import nice_ticks, time_ticks
from nvscope.view.lines.table import Line, Tone
from nvscope.view.lines.text_width import display_width
from nvscope.view.lines.value_axes import axes_of
from tests.laws import examples

S_NS = 1_000_000_000
NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-1e3, 1e3) | st.integers(-5, 5).map(float)
DOTS = {(0, 0): 1, (1, 0): 2, (2, 0): 4, (3, 0): 0x40, (0, 1): 8, (1, 1): 0x10, (2, 1): 0x20, (3, 1): 0x80}


def clock(time_ns: int, digits: int) -> str:
    return units.clock_time(time_ns, utc=True, digits=digits)


def curve_of(value: list[float], run: list[int] | None = None, step_ns: int = S_NS) -> Curve:
    return Curve(
        np.arange(len(value), dtype=np.int64) * step_ns,
        np.array(value, np.float64),
        np.array(run or [1] * len(value), np.int64),
    )


def axes_until(seconds: float, **how: object) -> Axes:
    return Axes(0, int(seconds * S_NS), clock, **how)  # type: ignore[arg-type]


def text_of(lines: list[Line]) -> list[str]:
    return ["".join(cell.text for cell in line).rstrip() for line in lines]


def dots_of(lines: list[Line], cells: int) -> set[tuple[int, int]]:
    """Return column and row, from below, of the dots in a drawing without scales."""
    found = set()
    for number, line in enumerate(lines):
        for column, sign in enumerate("".join(cell.text for cell in line)[-cells:]):
            for (down, right), bit in DOTS.items():
                if sign != " " and (ord(sign) - 0x2800) & bit:
                    found.add((2 * column + right, 4 * (len(lines) - number) - 1 - down))
    return found


@examples(300)
@given(st.lists(NUMBERS, max_size=40), st.data(), st.integers(1, 60), st.integers(1, 12))
def test_any_numbers_are_drawn_at_any_size(value: list[float], data: st.DataObject, width: int, height: int) -> None:
    time_ns = data.draw(st.lists(st.integers(-(2**62), 2**62), min_size=len(value), max_size=len(value)))
    run = data.draw(st.lists(st.integers(0, 3), min_size=len(value), max_size=len(value)))
    start_ns, end_ns = data.draw(st.tuples(st.integers(0, 2**61), st.integers(0, 2**61)))
    axes = Axes(
        start_ns, end_ns, clock, stepped=data.draw(st.booleans()), whole=data.draw(st.booleans()),
        levels=data.draw(st.sampled_from([{}, {0.0: "FALSE", 1.0: "TRUE"}])),
    )  # fmt: skip
    curve = Curve(np.array(time_ns, np.int64), np.array(value, np.float64), np.array(run, np.int64))
    lines, cells = plot(curve, axes, width, height, data.draw(st.none() | st.integers(0, 2**61)))
    assert len(lines) == height
    assert all(display_width("".join(cell.text for cell in line)) <= width for line in lines)
    assert 1 <= cells <= width


@pytest.mark.parametrize("value", [0.0, 5e-324, -5e-324, 1e-310, 1.0, -1e300, 1.7976931348623157e308])
def test_a_value_that_never_changes_is_a_line(value: float) -> None:
    lines, cells = plot(curve_of([value] * 3), axes_until(2), 40, 3, None)
    # Below are the times.
    assert len({row for _, row in dots_of(lines[:-1], cells)}) == 1


@examples()
@given(st.lists(st.floats(-1e300, 1e300), min_size=1, max_size=200), st.integers(1, 30), st.integers(1, 2))
def test_extremes_are_drawn(value: list[float], width: int, height: int) -> None:
    """However many values share a column: the highest and the lowest row have dots where the extremes are."""
    lines, cells = plot(curve_of(value), axes_until(len(value)), width, height)
    found = dots_of(lines, cells)
    columns = [number * 2 * cells // len(value) for number in range(len(value))]
    assume(min(value) < max(value))
    assert (columns[value.index(max(value))], 4 * height - 1) in found
    assert (columns[value.index(min(value))], 0) in found


@examples()
@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=100), st.integers(2, 40), st.booleans())
def test_what_rises_is_drawn_rising(value: list[float], width: int, stepped: bool) -> None:
    lines, cells = plot(curve_of(sorted(value)), axes_until(len(value), stepped=stepped), width, 2)
    found = dots_of(lines, cells)
    columns = sorted({column for column, _ in found})
    lowest = [min(row for at, row in found if at == column) for column in columns]
    highest = [max(row for at, row in found if at == column) for column in columns]
    assert (lowest, highest) == (sorted(lowest), sorted(highest))
    assert columns == list(range(columns[0], columns[-1] + 1)), "what is joined has no gap"


def test_what_is_not_joined_has_a_gap() -> None:
    value = [1.0] * 10 + [float("nan")] * 10 + [1.0] * 10 + [1.0] * 10
    run = [1] * 30 + [2] * 10
    time_ns = np.append(np.arange(30), np.arange(50, 60)) * S_NS
    curve = Curve(time_ns, np.array(value), np.array(run))
    lines, cells = plot(curve, axes_until(60), 35, 1)
    assert cells == 30
    columns = {column for column, _ in dots_of(lines, cells)}
    assert columns == {*range(10), *range(20, 30), *range(50, 60)}


def test_a_ramp_with_its_scales() -> None:
    lines, _ = plot(curve_of([float(number) for number in range(61)]), axes_until(60), 40, 6)
    assert text_of(lines) == [
        "50 ┤                             ⣀⣀⡠⠤⠔⠒⠉",
        "   │                      ⣀⣀⠤⠔⠒⠊⠉",
        "   │              ⣀⣀⠤⠔⠒⠒⠉⠉",
        "   │       ⣀⣀⠤⠔⠒⠊⠉",
        " 0 ┤⣀⠤⠔⠒⠊⠉⠉",
        "    ╵00:00:00         ╵00:00:30",
    ]


def test_bool_is_drawn_in_steps() -> None:
    axes = axes_of(SCALARS["BOOL"], np.array([0, 1], np.uint8), 0, 40 * S_NS, utc=True)
    lines, _ = plot(curve_of([0.0] * 10 + [1.0] * 20 + [0.0] * 10), axes, 28, 4)
    assert text_of(lines) == [
        " TRUE ┤     ⡏⠉⠉⠉⠉⠉⠉⠉⠉⠉⢹",
        "      │     ⡇         ⢸",
        "FALSE ┤⣀⣀⣀⣀⣀⡇         ⢸⣀⣀⣀⣀⡀",
        "       ╵00:00:00",
    ]


def test_values_of_an_enumeration_have_their_names() -> None:
    kind = Enumeration("eState", SCALARS["INT"], {"eIdle": 0, "eRun": 1, "eFault": 2, "eNever": 9})
    value = np.array([0, 1, 2, 1], np.int16)
    axes = axes_of(kind, value, 0, 4 * S_NS, utc=True)
    lines = text_of(plot(curve_of([0.0, 1.0, 2.0, 1.0]), axes, 40, 6).lines)
    assert [line.split(" ┤")[0].strip() for line in lines if "┤" in line] == ["eFault", "eRun", "eIdle"]
    assert axes.stepped


def test_the_cursor_is_a_line_at_its_time() -> None:
    axes = axes_until(10)
    lines, cells = plot(curve_of([5.0] * 10), axes, 20, 3, 5 * S_NS)
    at = cell_of(5 * S_NS, axes, cells)
    marked = [cell for line in lines[:-1] for cell in line if cell.tone is Tone.WARNING]
    assert len(marked) == 2
    assert text_of(lines)[1][20 - cells + (at or 0)] == "│"


@examples(200)
@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False),
       st.integers(1, 20), st.booleans())  # fmt: skip
def test_ticks_are_between_and_differ(one: float, other: float, most: int, whole: bool) -> None:
    low, high = min(one, other), max(one, other)
    ticks = nice_ticks(low, high, most, whole=whole)
    assert len(ticks) <= most
    assert all(low <= tick.value <= high for tick in ticks)
    if high - low > 1e-12 * max(abs(low), abs(high)):
        assert len({tick.text for tick in ticks}) == len(ticks)


def test_round_numbers_and_times() -> None:
    assert [tick.text for tick in nice_ticks(-3.2, 11, 6)] == ["0", "5", "10"]
    assert [tick.text for tick in nice_ticks(0.01, 0.05, 4)] == ["0.02", "0.04"]
    assert [tick.text for tick in nice_ticks(0, 3, 9, whole=True)] == ["0", "1", "2", "3"]
    assert [tick.text for tick in time_ticks(1 * S_NS, 61 * S_NS, 40, clock)] == ["00:00:30", "00:01:00"]
    assert [tick.text for tick in time_ticks(0, S_NS, 60, clock)] == [
        "00:00:00.0", "00:00:00.5", "00:00:01.0",
    ]  # fmt: skip
