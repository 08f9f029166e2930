"""The values of defined lists to files: wide, a file a list, or long, all in one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from nvscope.definition.model import ListDefinition
from nvscope.errors import UsageError
from nvscope.export.cycle_rows import CycleRows
from nvscope.export.files import TableFile, table_file
from nvscope.export.held import Slabs
from nvscope.export.interleaved import READ_SCHEMAS, Interleaved
from nvscope.export.long import LongTable, long_schema
from nvscope.export.part_names import part_name, path_of_part, plain
from nvscope.export.wide import WideTable, WideTables
from nvscope.list_key import ListKey
from nvscope.tracker.datalogger.on_demand import NAME as DATABASES
from nvscope.tracker.readings.observed import Observed, Reader
from nvscope.units import count
from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams, Place
from nvscope.whole_files import Existing, WholeFiles, is_stdout

if TYPE_CHECKING:
    from nvscope.export.database_rows import DatabaseRows
    from nvscope.tracker.readings.readings import ReadValues

OpenPart: TypeAlias = Callable[[str, Any], TableFile]
"""Returns the file of a part of what one tells, '' of a part alone, with the columns of a schema."""


class ReadRows(Reader, Protocol):
    """Whatever makes rows of what one tells; ``unit`` is what a row is, ``of_part`` how many each part has.

    ``misplaced`` counts values that have no place in their column.
    """

    unit: str
    misplaced: int

    @property
    def read(self) -> ReadValues: ...

    @property
    def of_part(self) -> Mapping[str, int]: ...

    def tables(self, schema: Any) -> Iterator[Any]:
        """Yield the values of the batch observed last, a row each, in the columns of a schema."""
        ...

    def write(self, open_part: OpenPart) -> None:
        """Write what the batch observed last brings, once."""
        ...

    def finish(self, open_part: OpenPart) -> None:
        """Write what is left."""
        ...


ReadOnes: TypeAlias = "Observed[ReadRows]"
"""What makes rows of values that come one by one, by name of who tells them, once there are any."""

MAX_FILES = 500
MAX_COLUMNS = 10_000


def write_wide(
    telegrams: DefinedTelegrams,
    rows: Iterable[DefinedRows],
    paths: Sequence[str],
    files: WholeFiles,
    *,
    by_cycle: bool = False,
    read_ones: ReadFiles | None = None,
) -> list[tuple[int, int]]:
    """Write the ``rows`` of each list to the file of its number; return how many there are of each.

    With ``by_cycle`` it is a row a cycle and not a telegram (``CycleRows``), without the bytes that nobody has
    described of several telegrams of a list: they have one column, and a row would hold the last of them. Values of
    ``read_ones`` go to files of their own, since nobody knows beforehand which variables they have. The second
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
        if read_ones is not None:
            read_ones.add()
    wide.finish()
    if read_ones is not None:
        read_ones.finish()
    return [(rows_written, table.beyond_time) for rows_written, table in zip(wide.rows, tables, strict=True)]


def write_long(
    telegrams: DefinedTelegrams, rows: Iterable[DefinedRows], path: str, files: WholeFiles,
    read_ones: ReadOnes | None = None,
) -> int:  # fmt: skip
    """Write the values of all ``rows`` to one file, and those of ``read_ones`` between them, by frame.

    Returns how many telegrams there are.
    """
    schema = long_schema(telegrams.keys)
    file: TableFile = table_file(files.open(path), schema)
    between: dict[str, Interleaved] = {}
    for name in READ_SCHEMAS:
        file = between[name] = Interleaved(file)
    long = LongTable(telegrams.places, telegrams.keys, lambda: telegrams.senders, file)
    for batch in rows:
        for name, known in read_ones.known.items() if read_ones is not None else ():
            between[name].begin(known.tables(schema))
        long.add(batch)
        for one in reversed(between.values()):
            one.end()
    long.finish()
    return long.telegrams


class ReadFiles:
    """Files of the values of each who tells them one by one; they are there from the first value on.

    With ``wide``, those of databases have a row a row of a table, and a file a table.
    """

    def __init__(
        self, paths: Mapping[str, str], files: WholeFiles, read_ones: ReadOnes, existing: Existing,
        wide: DatabaseRows | None = None,
    ) -> None:  # fmt: skip
        self._paths = paths
        self._files, self._read_ones, self._existing = files, read_ones, existing
        self._opened: dict[tuple[str, str], TableFile] = {}
        if wide is not None:
            wide.begin(self._opens(DATABASES))

    def add(self) -> None:
        """Write the values of the batch that was observed last."""
        for name, known in self._read_ones.known.items():
            known.write(self._opens(name))

    def open(self, name: str) -> None:
        """Make the file of those whom one tells, as one that has no row yet where there is none."""
        if not any(other == name for other, _ in self._opened):
            self._open(name, "", READ_SCHEMAS[name])

    def finish(self) -> None:
        """Write what stands at the end."""
        for name, known in self._read_ones.known.items():
            known.finish(self._opens(name))
        for file in self._opened.values():
            file.close()

    def _opens(self, name: str) -> OpenPart:
        return partial(self._open, name)

    def _open(self, name: str, part: str, schema: Any) -> TableFile:
        key = name, part
        if key not in self._opened:
            if part and is_stdout(self._paths[name]):
                raise UsageError(
                    "several tables cannot be written to stdout side by side",
                    next_step="choose a database with --list db/FILE, or write all values with --form long",
                )
            if len(self._opened) >= MAX_FILES:
                raise UsageError(
                    f"more than {count(MAX_FILES)} tables cannot be written side by side",
                    next_step="choose a database with --list db/FILE, or write all values with --form long",
                )
            existing = Existing.KEPT if part else self._existing
            file = self._files.open(path_of_part(self._paths[name], part), existing)
            self._opened[key] = table_file(file, schema)
        return self._opened[key]


def paths_of(path: str, lists: Sequence[tuple[ListKey, ListDefinition]]) -> list[str]:
    """Return the file of each list: with one list, or stdout, ``path``, else its name in front of the ending."""
    if len(lists) == 1 or is_stdout(path):
        return [path] * len(lists)
    found: list[str] = []
    taken: set[str] = set()
    for key, entry in lists:
        name = part_name(entry.name, "list")
        # Names that differ in case only are one to some file systems.
        if name.lower() in taken:
            name = f"{name}-{plain(str(key.port)) or key.transport}-{key.identifier}"
        taken.add(name.lower())
        found.append(path_of_part(path, name))
    return found
