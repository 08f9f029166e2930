"""Likeness: which variables of lists those are whose values come one by one, and which of their values are the same."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from dissectors.batch import I64, U8, U64
from nvscope.definition.variables import Element
from nvscope.tracker.readings.readings import Readings, ReadValues


class Likeness(Protocol):
    """What is known of it for the values of one protocol, ``name``.

    ``counts_missed``: what lists carried, and nobody told, is counted. ``ends_late``: where a value should have been
    told again, and is not, nobody knows what it is.
    """

    @property
    def name(self) -> str: ...

    @property
    def counts_missed(self) -> bool: ...

    @property
    def ends_late(self) -> bool: ...

    def read(self) -> ReadValues:
        """Return what finds the values."""
        ...

    def names(self, variable: Any) -> Sequence[str]:
        """Return what a list may call a variable, as ``plain`` writes it; the first name that one has is meant.

        A name may have that of the list and a point in front of it.
        """
        ...

    def is_like(self, variable: Any, element: Element) -> bool:
        """Tell whether both can be compared."""
        ...

    def of_read(self, variable: Any, readings: Readings, rows: I64) -> U64:
        """Return 64 bits for each of some values, as ``of_list`` does."""
        ...

    def of_list(self, variable: Any, element: Element, offset: int, data: U8) -> U64:
        """Return 64 bits for each value in telegrams, the same as those of the variable where it has that value."""
        ...


def plain(name: str) -> str:
    """Return a name in the form in which names are compared: in lower case, without spaces."""
    return "".join(name.split()).lower()
