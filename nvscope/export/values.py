"""The values of defined lists to files: wide, a file a list, or long, all in one."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from nvscope.definition.model import ListDefinition
from nvscope.errors import UsageError
from nvscope.export.cycle_rows import CycleRows
from nvscope.export.files import TableFile, table_file
from nvscope.export.held import Slabs
from nvscope.export.interleaved import PAGE_SCHEMA, Interleaved
from nvscope.export.long import LongTable, long_schema
from nvscope.export.wide import WideTable, WideTables
from nvscope.list_key import ListKey
from nvscope.tracker.visu.on_demand import PageObserver
from nvscope.units import count
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams, Place
from nvscope.whole_files import Existing, WholeFiles, is_stdout

if TYPE_CHECKING:
    from nvscope.export.page_tables import PageTables

Pages: TypeAlias = "PageObserver[PageTables]"
"""What makes tables of the values of pages, once there are any."""

MAX_FILES = 500
MAX_COLUMNS = 10_000

_UNSAFE = re.compile(r"[^\w-]+")
_MOST_NAME = 80


def write_wide(
    telegrams: DefinedTelegrams,
    rows: Iterable[DefinedRows],
    paths: Sequence[str],
    files: WholeFiles,
    *,
    by_cycle: bool = False,
    pages: PageFile | None = None,
) -> list[tuple[int, int]]:
    """Write the ``rows`` of each list to the file of its number; return how many there are of each.

    With ``by_cycle`` it is a row a cycle and not a telegram (``CycleRows``), without the bytes that nobody has
    described of several telegrams of a list: they have one column, and a row would hold the last of them. Values of
    ``pages`` go to a file of their own, since nobody knows beforehand which variables they have. The second
    number is how many times no column of times holds: they are null. Raises UsageError for more lists or columns than
    can be written side by side.
    """
    if len(paths) > MAX_FILES:
        raise UsageError(
            f"{count(len(paths))} lists are more than can be written side by side",
            next_step="choose some with --list, or write one file of all with --form long",
        )
    if len(paths) > 1 and is_stdout(paths[0]):
        raise UsageError(
            f"{count(len(paths))} lists cannot be written to stdout side by side",
            next_step="choose one with --list, or write all below each other with --form long",
        )
    places: list[list[Place]] = [[] for _ in paths]
    for place in telegrams.places:
        places[place.number].append(place)
    slabs = Slabs()
    tables = [WideTable(of_list, lambda: telegrams.senders, slabs) for of_list in places]
    for table, (first, *_) in zip(tables, places, strict=True):
        if table.variables > MAX_COLUMNS:
            raise UsageError(
                f"list {first.layout.list.name} has {count(table.variables)} variables, more than a table can have "
                "columns",
                next_step="write them below each other with --form long, or choose other lists with --list",
            )
    # Opened at once: that one cannot be written is to be said before a long capture is read.
    named = Existing.REPLACED if len(paths) == 1 else Existing.KEPT
    opened = [files.open(path, named) for path in paths]
    cycles = [
        CycleRows(
            table.schema,
            first.layout.list.interval_ns if first.layout.list.cyclic else None,
            table.sent,
            table.of_several,
            lambda: telegrams.recordings_from,
        )
        for table, (first, *_) in zip(tables, places, strict=True)
        if by_cycle
    ]
    written = cycles or tables
    wide = WideTables(
        tables, lambda number: table_file(opened[number], written[number].schema), telegrams.places, cycles
    )
    for batch in rows:
        wide.add(batch)
        if pages is not None:
            pages.add()
    wide.finish()
    if pages is not None:
        pages.finish()
    return [(rows_written, table.beyond_time) for rows_written, table in zip(wide.rows, tables, strict=True)]


def write_long(
    telegrams: DefinedTelegrams, rows: Iterable[DefinedRows], path: str, files: WholeFiles,
    pages: Pages | None = None,
) -> int:  # fmt: skip
    """Write the values of all ``rows`` to one file, and those of ``pages`` between them, by frame.

    Returns how many telegrams there are.
    """
    schema = long_schema(telegrams.keys)
    file = Interleaved(table_file(files.open(path), schema))
    long = LongTable(telegrams.places, telegrams.keys, lambda: telegrams.senders, file)
    for batch in rows:
        if pages is not None and pages.known is not None:
            file.begin(pages.known.tables(schema))
        long.add(batch)
        file.end()
    long.finish()
    return long.telegrams


class PageFile:
    """A file of the values of pages alone; it is there from the first value on."""

    def __init__(self, path: str, files: WholeFiles, pages: Pages, existing: Existing) -> None:
        self.path = path
        self._files, self._pages, self._existing = files, pages, existing
        self._file: TableFile | None = None

    def add(self) -> None:
        """Write the values of the batch that was observed last."""
        if self._pages.known is None:
            return
        for table in self._pages.known.tables(PAGE_SCHEMA):
            self.open().write(table)

    def open(self) -> TableFile:
        """Return the file, as one that has no row yet where there is none."""
        if self._file is None:
            self._file = table_file(self._files.open(self.path, self._existing), PAGE_SCHEMA)
        return self._file

    def finish(self) -> None:
        """Write what stands at the end."""
        if self._file is not None:
            self._file.close()


def path_of_pages(path: str) -> str:
    """Return the file of the values of pages, beside those of lists."""
    whole = Path(path)
    return str(whole.with_name(f"{whole.stem}.visu{whole.suffix}"))


def paths_of(path: str, lists: Sequence[tuple[ListKey, ListDefinition]]) -> list[str]:
    """Return the file of each list: with one list, or stdout, ``path``, else its name in front of the ending."""
    if len(lists) == 1 or is_stdout(path):
        return [path] * len(lists)
    whole = Path(path)
    found: list[str] = []
    taken: set[str] = set()
    for key, entry in lists:
        name = _UNSAFE.sub("_", entry.name)[:_MOST_NAME] or "list"
        # Names that differ in case only are one to some file systems.
        if name.lower() in taken:
            name = f"{name}-{_UNSAFE.sub('_', str(key.port)) or key.transport}-{key.identifier}"
        taken.add(name.lower())
        found.append(str(whole.with_name(f"{whole.stem}.{name}{whole.suffix}")))
    return found
