"""``nvscope export``: values of variables that come one by one."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
from typing import TYPE_CHECKING

from nvscope.cli.terminal import echo
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.analysis.read_values import ReadSource
    from nvscope.capture.source import Source
    from nvscope.engine.run import Observer
    from nvscope.export.database_rows import DatabaseRows
    from nvscope.export.values import ReadOnes, ReadRows
    from nvscope.tracker.readings.readings import Wanted
    from nvscope.view.display_filter import DisplayFilter
    from nvscope.whole_files import WholeFiles


def observed_readings(listed: Sequence[str], *, secrets: bool, wide: DatabaseRows | None = None) -> ReadOnes | None:
    """Return what observes the values that are meant and come one by one, None where only lists are.

    ``wide`` is what makes rows of databases, where these are not to have a row a value.
    """
    from nvscope.analysis.read_values import meant_by_lists
    from nvscope.tracker.datalogger.on_demand import NAME
    from nvscope.tracker.readings.observed import Observed

    def make(source: ReadSource, wanted: Wanted | None) -> ReadRows:
        from nvscope.export.interleaved import READ_SCHEMAS
        from nvscope.export.read_tables import FURTHER, ReadTables

        if wide is not None and source.name == NAME:
            return wide
        return ReadTables(source.read(wanted), FURTHER[source.name], READ_SCHEMAS[source.name], secrets=secrets)

    wanted = meant_by_lists(listed)
    if not wanted:
        return None
    return Observed({one.name: partial(make, one, own) for one, own in wanted.items()})


def meant_are_databases(listed: Sequence[str]) -> bool:
    """Tell whether databases are all that is meant by what stands for lists."""
    from nvscope.analysis.read_values import meant_by_lists
    from nvscope.tracker.datalogger.on_demand import NAME

    return [one.name for one in meant_by_lists(listed)] == [NAME]


def rows_of_databases(source: Source, listed: Sequence[str], most: int) -> DatabaseRows | None:
    """Return what makes rows of the databases of a source that are meant, None where there are none."""
    from nvscope.analysis.read_values import meant_by_lists
    from nvscope.capture.formats import DATABASES
    from nvscope.tracker.datalogger.on_demand import NAME

    paths = [info.path for info in source.infos if info.format in DATABASES]
    own = {one.name: wanted for one, wanted in meant_by_lists(listed).items()}
    if not paths or NAME not in own:
        return None
    from nvscope.capture.datalogger.reader import tables_in
    from nvscope.export.database_rows import DatabaseRows

    return DatabaseRows(own[NAME], [table for path in paths for table in tables_in(path)], most)


def check_read_alone(form: str | None, by: str | None, *, only_databases: bool) -> None:
    """Raise UsageError for a form that values do not have that come one by one."""
    if by is not None:
        raise UsageError("--rows: telegrams of lists have cycles, and nothing else", next_step="leave --rows out")
    if form == "wide" and not only_databases:
        raise UsageError(
            "--form wide: values of web visualization have a row each",
            next_step="leave it out; --list 'db/*' chooses databases, whose rows can be rows here",
        )


def nothing_defined(inquiry: Inquiry) -> UsageError:
    """Return the error that there are no values: neither is a list defined, nor did a page ask for any."""
    if inquiry.project.files:
        return inquiry.nothing_defined()
    return UsageError(
        "no list is defined, and no page of a web visualization asked for values",
        next_step="name the exported lists and their types with --gvl FILE",
    )


def write_read_alone(
    inquiry: Inquiry, source: Source, chosen: DisplayFilter | None, read_ones: ReadOnes, path: str, files: WholeFiles,
    wide: DatabaseRows | None = None, others: Sequence[Observer] = (),
) -> int:  # fmt: skip
    """Write values that come one by one to a file; return how many frames were read. ``others`` observe, too.

    Of databases beside captures they go to a file of their own.
    """
    from nvscope.capture.formats import DATABASES, are_databases
    from nvscope.export.part_names import path_of_part
    from nvscope.export.values import ReadFiles
    from nvscope.whole_files import Existing, is_stdout

    first = "db" if are_databases(source.infos) else "visu"
    paths = {name: path if name == first else path_of_part(path, name) for name in read_ones.makes}
    if len(paths) > 1 and is_stdout(path):
        both = first == "visu" and any(info.format in DATABASES for info in source.infos)
        if both:
            raise UsageError(
                "values of databases and of web visualization cannot be written to stdout side by side",
                next_step="choose some with --list 'db/*' or --list 'visu/*', or name a file",
            )
    if first not in paths:
        first, paths = next(iter(paths)), {next(iter(paths)): path}
    file = ReadFiles(paths, files, read_ones, Existing.REPLACED, wide)
    file.open(first)
    frames = 0
    for told in inquiry.run(source, [read_ones, *others], chosen, watch=lambda _: nullcontext(lambda: None)):
        frames += len(told)
        file.add()
    file.finish()
    return frames


def tell_of_exported_readings(
    read_ones: ReadOnes, path: str, *, alone: bool, long: bool, secrets: bool, quiet: bool
) -> None:  # fmt: skip
    """Say where the values are that came one by one, how many are hidden, and what was left out."""
    from nvscope.cli.read_notes import tell_of_read_ones
    from nvscope.export.part_names import path_of_part
    from nvscope.units import count_of
    from nvscope.view.escape import visible
    from nvscope.whole_files import is_stdout

    if alone and not any(any(known.of_part.values()) for known in read_ones.known.values()):
        what = "no page asked for a value" if list(read_ones.makes) == ["visu"] else "no value came"
        echo(f"nvscope: {what} that could be read; {visible(path)} has columns, but no rows.", err=True)
    for name, known in read_ones.known.items():
        if not alone and not long and is_stdout(path):
            echo(f"nvscope: values of {known.read.title} are left out; --form long writes them too.", err=True)
            continue
        for part, rows in known.of_part.items():
            if rows and (part or not alone) and not long and not quiet:
                where = visible(path_of_part(path if alone else path_of_part(path, name), part))
                echo(f"nvscope: {where}: {count_of(rows, known.unit)} of {known.read.title}", err=True)
        if known.misplaced:
            echo(
                f"nvscope: {count_of(known.misplaced, 'value')} of another type than the column is declared as, "
                "null; --form long has them as they are.",
                err=True,
            )
        tell_of_read_ones([known.read], hidden=0 if secrets else known.read.hidden)


def tell_of_values_of_pages(path: str) -> None:
    """Say how the values are written that pages asked for, where what asked for them was."""
    from nvscope.view.escape import visible

    echo(
        f"nvscope: {visible(path)}: telegrams, and messages of web visualization; --what values writes the values that "
        "pages asked for, --list visu/ADDRESS those of one controller.",
        err=True,
    )
