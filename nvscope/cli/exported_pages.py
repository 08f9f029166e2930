"""``nvscope export``: values of variables of web visualization."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING

from nvscope.cli.terminal import echo
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source
    from nvscope.export.page_tables import PageTables
    from nvscope.export.values import Pages
    from nvscope.view.display_filter import DisplayFilter
    from nvscope.whole_files import WholeFiles


def observed_pages(listed: Sequence[str], *, secrets: bool) -> Pages | None:
    """Return what observes the values of pages that are meant, None where only lists are."""
    from nvscope.analysis.page_values import selection_of_lists
    from nvscope.tracker.visu.on_demand import PageObserver

    wanted = selection_of_lists(listed)
    if wanted is None:
        return None

    def make() -> PageTables:
        from nvscope.export.page_tables import PageTables

        return PageTables(wanted, secrets=secrets)

    return PageObserver(make)


def check_pages_alone(form: str | None, by: str | None) -> None:
    """Raise UsageError for a form that values of pages do not have by themselves."""
    if form == "wide" or by is not None:
        told = "--rows" if by else "--form wide"
        raise UsageError(
            f"{told}: values of web visualization have a row each, since which variables there are is known in the end",
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


def write_pages_alone(
    inquiry: Inquiry, source: Source, chosen: DisplayFilter | None, pages: Pages, path: str, files: WholeFiles
) -> int:
    """Write the values of pages to a file; return how many frames were read."""
    from nvscope.export.values import PageFile
    from nvscope.whole_files import Existing

    file = PageFile(path, files, pages, Existing.REPLACED)
    file.open()
    frames = 0
    for told in inquiry.run(source, [pages], chosen, watch=lambda _: nullcontext(lambda: None)):
        frames += len(told)
        file.add()
    file.finish()
    return frames


def tell_of_exported_pages(
    pages: Pages, path: str, *, alone: bool, long: bool, secrets: bool, quiet: bool
) -> None:  # fmt: skip
    """Say where the values of pages are, how many are hidden, and what was left out."""
    from nvscope.cli.page_notes import tell_of_pages
    from nvscope.export.values import path_of_pages
    from nvscope.units import count_of
    from nvscope.view.escape import visible
    from nvscope.whole_files import is_stdout

    known = pages.known
    rows = known.rows if known else 0
    if alone and not rows:
        echo(
            f"nvscope: no page asked for a value that could be read; {visible(path)} has columns, but no rows.",
            err=True,
        )
    if known is None:
        return
    if not alone and not long and is_stdout(path):
        echo("nvscope: values of web visualization are left out; --form long writes them too.", err=True)
        return
    if rows and not alone and not long and not quiet:
        echo(f"nvscope: {visible(path_of_pages(path))}: {count_of(rows, 'value')} of web visualization", err=True)
    tell_of_pages(known.read, hidden=0 if secrets else known.read.hidden)


def tell_of_values_of_pages(path: str) -> None:
    """Say how the values are written that pages asked for, where what asked for them was."""
    from nvscope.view.escape import visible

    echo(
        f"nvscope: {visible(path)}: telegrams, and messages of web visualization; --what values writes the values that "
        "pages asked for, --list visu/ADDRESS those of one controller.",
        err=True,
    )
