"""How the intervals of each list are spread, as bars: two habits of a list are told from jitter by their two peaks.

Takes the report of schema ``nvscope.report/2`` and the ``IntervalShapes`` beside it. Nothing here is escaped.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from nvscope import units
from nvscope.view.lines.plant.content import Report, node_names
from nvscope.view.lines.plant.strips import keys_among, shown_lists
from nvscope.view.lines.table import NOTHING, Cell, Column, Tone

if TYPE_CHECKING:
    from nvscope.view.interval_shapes import Bar, IntervalShape, IntervalShapes

TITLE = "Timing"
CELLS = 24
LEVELS = "▁▂▃▄▅▆▇█"
NOMINAL = "│"
"""Stands in front of the cell in which the nominal interval lies."""

LEGEND = (
    f"{NOMINAL} the nominal interval. The bars tell how many intervals are how long, on a logarithmic scale; what lies "
    "far beyond its ends is counted behind it."
)

NO_INTERVALS = "No list was sent twice by a sender."

_COLUMNS = (
    Column("list", shortest=8, identifier=True),
    Column("sender", shortest=12, importance=4, identifier=True),
    Column("p50", right=True, importance=3),
    Column("p99", right=True, importance=1),
    Column("from", right=True, importance=5),
    Column("intervals", verbatim=True),
    Column("to", right=True, importance=5),
    Column("beyond", right=True, importance=2),
)


class Timing(NamedTuple):
    """The table: its columns, and a row of cells for each sender of the lists shown, as the strips have them."""

    columns: list[Column]
    rows: list[list[Cell]]


def timing(report: Report, shapes: IntervalShapes, *, keys: bool = False, every: bool = False) -> Timing:
    """Return the table; ``keys``: lists are told by their keys; ``every``: no list is left out."""
    entries = shown_lists(report, every=every).entries
    names, nodes = units.short_list_keys(entry["key"] for entry in report["lists"]), node_names(report)
    rows = []
    for entry, key in zip(entries, keys_among([entry["key"] for entry in entries], shapes.lists), strict=True):
        senders = {stream["node"] for stream in entry["streams"]}
        name = units.list_key(entry["key"]) if keys else entry["name"] or names[entry["key"]]
        for node, shape in shapes.of(key).items():
            bar = shape.bar(CELLS)
            if node in senders and bar is not None:
                sender = NOTHING if node is None else nodes.get(node) or node
                rows.append([Cell(name, Tone.STRONG), Cell(sender), *_cells(shape, bar)])
    places = [place for place in range(len(_COLUMNS)) if any(row[place].text not in ("", NOTHING) for row in rows)]
    return Timing([_COLUMNS[place] for place in places], [[row[place] for place in places] for row in rows])


def _cells(shape: IntervalShape, bar: Bar) -> list[Cell]:
    p50, p99 = (NOTHING if time_ns is None else units.duration(time_ns) for time_ns in (shape.p50_ns, shape.p99_ns))
    first, last = units.duration(bar.first_ns), units.duration(bar.last_ns)
    blocks, beyond = Cell(drawn(bar.cells, bar.nominal)), bar.shorter + bar.longer
    ends = Cell(first, Tone.FAINT), blocks, Cell(last, Tone.FAINT)
    return [Cell(p50), Cell(p99), *ends, Cell(units.count(beyond) if beyond else NOTHING)]


def drawn(cells: Sequence[int], nominal: int | None) -> str:
    """Return a bar: a block for each cell with something in it, the highest where most is."""
    most = max(cells, default=0)
    blocks = [LEVELS[-(-len(LEVELS) * one // most) - 1] if one else " " for one in cells]
    if nominal is not None:
        blocks.insert(nominal, NOMINAL)
    return "".join(blocks)
