"""How a variable is shown: what changed just now stands out, and less and less; what has grown old looks so."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from nvscope import units
from nvscope.view.escape import visible
from nvscope.view.lines.table import NOTHING, Cell, Column, Tone
from nvscope.view.lines.text_width import display_width, head
from nvscope.view.lines.variable_rows import RowKey

if TYPE_CHECKING:
    from nvscope.view.lines.variable_rows import AnyGroup, AnyRow

_Any = TypeVar("_Any")

_S_NS = 1_000_000_000
JUST_NS = _S_NS
"""So long a value stands out that has changed."""

LATELY_NS = 3 * _S_NS
"""So long it is marked."""

MOST_VALUE = 60
"""Values are cut at so many columns."""

COLUMNS: Sequence[Column] = (
    Column(""),
    Column("list", shortest=12, importance=6, identifier=True),
    Column("sender", shortest=9, importance=2, identifier=True),
    Column("variable", shortest=12, identifier=True),
    Column("value", shortest=12),
    Column("type", shortest=8, importance=1),
    Column("changed", right=True, importance=8),
    Column("changes", right=True, importance=7),
    Column("min", right=True, importance=4),
    Column("max", right=True, importance=4),
    Column(""),
)


_SENDER = next(place for place, column in enumerate(COLUMNS) if column.title == "sender")


def without_senders(cells: Sequence[_Any]) -> Sequence[_Any]:
    """Return columns, or the cells of a row, without those of senders: nobody sent what is in databases."""
    return [*cells[:_SENDER], *cells[_SENDER + 1 :]]


class Freshness(IntEnum):
    """How long ago a value changed."""

    CALM = 0
    LATELY = 1
    JUST = 2


_MARKS = {Freshness.JUST: Cell("◆", Tone.NOTE), Freshness.LATELY: Cell("◇"), Freshness.CALM: Cell("")}
LEGEND = "◆ changed within 1 s   ◇ 3 s"


def freshness(row: AnyRow, now_ns: int) -> Freshness:
    """Return how long ago a value changed; one that never did is calm."""
    if not row.changes:
        return Freshness.CALM
    passed_ns = now_ns - row.changed_ns
    return Freshness.JUST if passed_ns < JUST_NS else Freshness.LATELY if passed_ns < LATELY_NS else Freshness.CALM


class Notch:
    """The variables that are left unmarked, since they changed when somebody said so; none in the beginning."""

    def __init__(self) -> None:
        self._left: set[RowKey] = set()

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._left)

    def cut(self, groups: Sequence[AnyGroup], now_ns: int) -> None:
        """Leave unmarked from now on what has changed lately."""
        self._left = {
            group.row(at).key
            for group in groups
            for at in np.flatnonzero((group.changes > 0) & (now_ns - group.changed_ns < LATELY_NS)).tolist()
        }

    def clear(self) -> None:
        """Mark everything again."""
        self._left = set()

    def __contains__(self, key: RowKey) -> bool:
        return key in self._left


def cells(
    row: AnyRow, now_ns: int, *, list_name: str, sender: str, notched: bool, grown_old: str = "",
) -> list[Cell]:  # fmt: skip
    """Return the cells of a row, by ``COLUMNS``.

    ``list_name`` and ``sender`` are visible already. ``grown_old`` says why nobody knows whether the value is still
    the same, "" where somebody does.
    """
    old = bool(grown_old)
    fresh = Freshness.CALM if old or notched else freshness(row, now_ns)
    tone = Tone.FAINT if old else Tone.STRONG if fresh is Freshness.JUST else Tone.PLAIN
    bounds = row.bounds
    least, most = (Cell(NOTHING, Tone.FAINT),) * 2 if bounds is None else (Cell(visible(text)) for text in bounds)
    return [
        _MARKS[fresh],
        Cell(list_name, Tone.FAINT),
        Cell(sender, Tone.FAINT),
        Cell(visible(row.name)),
        Cell(cut(visible(row.text)), tone),
        Cell(visible(row.type_text), Tone.FAINT),
        Cell(age(now_ns - row.changed_ns)) if row.changes else Cell("never", Tone.FAINT),
        Cell(units.count(row.changes)) if row.changes else Cell("0", Tone.FAINT),
        least,
        most,
        Cell(grown_old, Tone.WARNING),
    ]


def cut(text: str, width: int = MOST_VALUE) -> str:
    """Return a visible text, with an ellipsis in place of its end where it is wider."""
    return text if display_width(text) <= width else f"{head(text, width - 1)}…"


def age(passed_ns: int) -> str:
    """Return how long ago something was, in whole seconds below a minute."""
    if passed_ns < 60 * _S_NS:
        return f"{max(passed_ns, 0) // _S_NS} s"
    return units.duration(passed_ns)
