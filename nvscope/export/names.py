"""Names of columns, and of the values of enumerations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import I64
from nvscope.definition.variables import Element, Enumeration
from nvscope.expression.typed_columns import Numbers

_NAME_SUFFIX = ".name"


class Names:
    """Gives each variable a column of its own name; ``var.`` goes in front of one that is taken already.

    Where two definitions of a list have a variable with different types, the column of the second has the type behind
    its name: ``pos : LREAL``.
    """

    def __init__(self, taken: set[str]) -> None:
        self._taken = set(taken)

    def free(self, element: Element, *, typed: bool = False) -> tuple[str, str]:
        """Return the names of an element's column, and of the column with its value's name, empty where it has none."""
        name = self.of(f"{element.name} : {element.type.name}" if typed else element.name)
        return name, self.of(name + _NAME_SUFFIX) if isinstance(element.type, Enumeration) else ""

    def of(self, name: str) -> str:
        """Return the name of a column of its own."""
        while name in self._taken:
            name = f"var.{name}"
        self._taken.add(name)
        return name


def value_names(kind: Enumeration, numbers: Numbers) -> tuple[I64, Sequence[str]]:
    """Return the names of an enumeration's values as places in a table, -1 where a number has none.

    Of several names of one number, the first.
    """
    by_number: dict[int, str] = {}
    for name, number in kind.values.items():
        by_number.setdefault(number, name)
    bounds = np.iinfo(numbers.dtype)
    known = sorted(number for number in by_number if bounds.min <= number <= bounds.max)
    if not known:
        return np.full(len(numbers), -1), [""]
    table = np.array(known, numbers.dtype)
    place = np.minimum(np.searchsorted(table, numbers), len(table) - 1)
    return np.where(table[place] == numbers, place, -1), [by_number[number] for number in known]
