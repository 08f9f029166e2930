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
    from nvscope.export.read_tables import ReadTables
    from nvscope.export.values import ReadOnes
    from nvscope.tracker.readings.readings import Wanted
    from nvscope.view.display_filter import DisplayFilter
    from nvscope.whole_files import WholeFiles


def observed_readings(listed: Sequence[str], *, secrets: bool) -> ReadOnes | None:
    """Return what observes the values that are meant and come one by one, None where only lists are."""
    from nvscope.analysis.read_values import meant_by_lists
    from nvscope.tracker.readings.observed import Observed

    def make(source: ReadSource, wanted: Wanted | None) -> ReadTables:
        from nvscope.export.read_tables import FURTHER, ReadTables

        return ReadTables(source.read(wanted), FURTHER[source.name], secrets=secrets)

    wanted = meant_by_lists(listed)
    if not wanted:
        return None
    return Observed({one.name: partial(make, one, own) for one, own in wanted.items()})


def check_read_alone(form: str | None, by: str | None) -> None:
    """Raise UsageError for a form that values do not have that come one by one."""
    if form == "wide" or by is not None:
        told = "--rows" if by else "--form wide"
        raise UsageError(
            f"{told}: values of web visualization and of databases have a row each",
            next_step=f"leave {told} out",
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
    inquiry: Inquiry, source: Source, chosen: DisplayFilter | None, read_ones: ReadOnes, path: str, files: WholeFiles
) -> int:
    """Write values that come one by one to a file; return how many frames were read.

    Of databases beside captures they go to a file of their own.
    """
    from nvscope.capture.formats import DATABASES
    from nvscope.export.values import ReadFiles, path_of_read_ones
    from nvscope.whole_files import Existing, is_stdout

    first = "db" if are_databases(source) else "visu"
    paths = {name: path if name == first else path_of_read_ones(path, name) for name in read_ones.makes}
    if len(paths) > 1 and is_stdout(path):
        both = first == "visu" and any(info.format in DATABASES for info in source.infos)
        if both:
            raise UsageError(
                "values of databases and of web visualization cannot be written to stdout side by side",
                next_step="choose some with --list 'db/*' or --list 'visu/*', or name a file",
            )
    if first not in paths:
        first, paths = next(iter(paths)), {next(iter(paths)): path}
    file = ReadFiles(paths, files, read_ones, Existing.REPLACED)
    file.open(first)
    frames = 0
    for told in inquiry.run(source, [read_ones], chosen, watch=lambda _: nullcontext(lambda: None)):
        frames += len(told)
        file.add()
    file.finish()
    return frames


def are_databases(source: Source) -> bool:
    """Tell whether there is nothing in a source but databases."""
    from nvscope.capture.formats import DATABASES

    return bool(source.infos) and all(info.format in DATABASES for info in source.infos)


def tell_of_exported_readings(
    read_ones: ReadOnes, path: str, *, alone: bool, long: bool, secrets: bool, quiet: bool
) -> None:  # fmt: skip
    """Say where the values are that came one by one, how many are hidden, and what was left out."""
    from nvscope.cli.read_notes import tell_of_read_ones
    from nvscope.export.values import path_of_read_ones
    from nvscope.units import count_of
    from nvscope.view.escape import visible
    from nvscope.whole_files import is_stdout

    if alone and not any(known.rows for known in read_ones.known.values()):
        what = "no page asked for a value" if list(read_ones.makes) == ["visu"] else "no value came"
        echo(f"nvscope: {what} that could be read; {visible(path)} has columns, but no rows.", err=True)
    for name, known in read_ones.known.items():
        if not alone and not long and is_stdout(path):
            echo(f"nvscope: values of {known.read.title} are left out; --form long writes them too.", err=True)
            continue
        if known.rows and not alone and not long and not quiet:
            where = visible(path_of_read_ones(path, name))
            echo(f"nvscope: {where}: {count_of(known.rows, 'value')} of {known.read.title}", err=True)
        tell_of_read_ones([known.read], hidden=0 if secrets else known.read.hidden)


def tell_of_values_of_pages(path: str) -> None:
    """Say how the values are written that pages asked for, where what asked for them was."""
    from nvscope.view.escape import visible

    echo(
        f"nvscope: {visible(path)}: telegrams, and messages of web visualization; --what values writes the values that "
        "pages asked for, --list visu/ADDRESS those of one controller.",
        err=True,
    )
