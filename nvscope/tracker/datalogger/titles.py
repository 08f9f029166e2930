"""What stands for databases in the place of lists, one for each series of files."""

from __future__ import annotations

import os

from dissectors.datalogger.logged import RowTable


class Titles:
    """Titles by series; those of one name in several folders have that of the folder in it, all but the first."""

    def __init__(self) -> None:
        self._titles: dict[str, str] = {}

    def of(self, table: RowTable) -> str:
        """Return what the database of a table is called."""
        title = self._titles.get(table.series)
        if title is None:
            title = table.title
            taken = set(self._titles.values())
            if title in taken:
                folder = os.path.basename(os.path.dirname(os.path.abspath(table.series)))
                prefix, _, name = title.partition("/")
                title = f"{prefix}/{folder}/{name}"
            plain, number = title, 2
            while title in taken:
                title, number = f"{plain} ({number})", number + 1
            self._titles[table.series] = title
        return title
