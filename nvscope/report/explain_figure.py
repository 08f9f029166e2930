"""What a figure tells: a row of the table of figures, for people at a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from types import MappingProxyType

from nvscope.tracker.figures import FIGURES, PLACES, Figure, Of
from nvscope.view.lines.table import Cell, Line, Tone, wrap

COLUMNS = MappingProxyType(
    {
        "sent": "nSendCount", "no ack": "missing_acknowledgements", "last error": "sLastError", "dup": "duplicates",
        "interval": "interval_p50", "median": "interval_p50", "defined": "interval_nominal",
        **{
            name: f"interval_{name}"
            for name in ("nominal", "min", "p50", "p95", "p99", "max", "mean", "stddev", "count")
        },
    }
)  # fmt: skip
"""Columns of reports that have another title than the figure that stands in them."""

_OF_WIDTH = max(len(of.value) for of in Of) + 2
_UNITS = {"time": "a time", "ns": "a duration in ns", "percent": "percent", "": "a text"}
"""Those that are no plural of what is counted."""


def figure_called(name: str) -> Figure | None:
    """Return the figure of a name in lower case, of a column of reports or of a word such as ``list.lost``, or None."""
    of, _, rest = COLUMNS.get(" ".join(name.split()), name).lower().rpartition(".")
    for figure in FIGURES:
        if figure.name.lower() == rest and (not of or of in {one.value for one in figure.of}):
            return figure
    return None


def figure_lines(figure: Figure, width: int) -> Iterator[Line]:
    """Yield what a figure tells, of what, and where it is told."""
    unit = _UNITS.get(figure.unit, figure.unit)
    yield from wrap([Cell(figure.name, Tone.STRONG), Cell("  "), Cell(f"figure, {unit}", Tone.NOTE)], width, hanging=2)
    yield []
    yield from wrap([Cell(f"{figure.help[0].upper()}{figure.help[1:]}.")], width)
    yield []
    for of in figure.of:
        yield from wrap([Cell(of.value.ljust(_OF_WIDTH)), Cell(_told(figure, of))], width, hanging=_OF_WIDTH)
    yield []
    provided = f", where {figure.provided.value}" if figure.provided else ""
    yield from wrap([Cell(f"Of several windows joined: {figure.joins.value}{provided}.")], width)


def _told(figure: Figure, of: Of) -> str:
    path = figure.keys.get(of)
    in_reports = "in no report" if path is None else f"in report --json {PLACES[of]}.{path}"
    # Telegrams have a list, a sender and a bus that expressions ask for; for its stream they have no word.
    return in_reports if of is Of.STREAM else f"in expressions {of.value}.{figure.name}, {in_reports}"
