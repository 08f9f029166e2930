"""The variables of databases: one for each name in each series of files, whichever of its tables has it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.datalogger.logged import RowTable
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Elementary, String
from nvscope.tracker.datalogger.titles import Titles
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.readings import LEFT_OUT, in_order

_WHOLE, _REAL, _LREAL = SCALARS["LINT"], SCALARS["REAL"], SCALARS["LREAL"]
_TEXT = String()
_SINGLE = "FLOAT"


class DatabaseVariable(Struct):
    """A variable of a ``series`` of files; ``type`` is what its column is declared as, where it was seen last.

    ``lasts``: only changes are stored there.
    """

    series: str
    list: str
    name: str
    type: str
    order: tuple[Any, ...]
    lasts: bool

    @property
    def is_secret(self) -> bool:
        """Nothing in a database is hidden from whoever has it."""
        return False

    @property
    def identity(self) -> Hashable:
        """What tells it from all others: two databases may be called the same."""
        return self.series, self.name

    @property
    def short_name(self) -> str:
        """Its name behind the last slash: that in its program."""
        return self.name.rpartition("/")[2]

    @property
    def usual_form(self) -> Form:
        """The form of its values: as its column is declared."""
        return usual_form_of(self.type)

    def as_shown(self, text: str) -> str:
        """Return a text as it is."""
        return text

    def kind_of(self, form: int, bits: int) -> Elementary | None:
        """Return the type by which a value is shown: as it is stored, whatever the column is declared as."""
        if form == Form.WHOLE:
            return _WHOLE
        if form == Form.TEXT:
            return _TEXT
        if form != Form.REAL:
            return None
        number = np.uint64(bits).view(np.float64)
        with np.errstate(over="ignore"):
            is_single = self.type.upper() == _SINGLE and np.float32(number) == number
        return _REAL if is_single else _LREAL


def usual_form_of(declared: str) -> Form:
    """Return the form of values in a column that is declared so."""
    kind = declared.upper()
    return Form.REAL if kind in ("FLOAT", "DOUBLE") else Form.TEXT if kind == "TEXT" else Form.WHOLE


class DatabaseVariables:
    """The variables seen so far, by number. ``left_out``: there was no room for some."""

    def __init__(self) -> None:
        self.left_out = False
        self._known: list[DatabaseVariable] = []
        self._numbers: dict[tuple[str, str], int] = {}
        self._of_tables: dict[RowTable, I64] = {}
        self._titles = Titles()

    @property
    def known(self) -> Sequence[DatabaseVariable]:
        """The variables, by number."""
        return self._known

    def title_of(self, table: RowTable) -> str:
        """Return what stands for the list of a table."""
        return self._titles.of(table)

    def of(self, table: RowTable, most: int) -> I64:
        """Return the numbers of the variables of a table, ``LEFT_OUT`` of those beyond ``most``."""
        found = self._of_tables.get(table)
        if found is None:
            found = self._of_tables[table] = self._added(table, most)
        return found

    def _added(self, table: RowTable, most: int) -> I64:
        title = self._titles.of(table)
        numbers, lasts = [], table.log.only_changes
        for variable in table.log.variables:
            number = self._numbers.get((table.series, variable.name))
            if number is not None:
                self._known[number].type, self._known[number].lasts = variable.declared, lasts
            elif len(self._known) >= most:
                self.left_out = True
                number = LEFT_OUT
            else:
                number = self._numbers[table.series, variable.name] = len(self._known)
                order = title, in_order(variable.name), variable.name
                self._known.append(
                    DatabaseVariable(table.series, title, variable.name, variable.declared, order, lasts)
                )
            numbers.append(number)
        return np.array(numbers, np.int64)
