"""What is asked of ``nvscope vars``, and what the captures that were read for it say of themselves."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec import Struct

from nvscope.analysis.read_values import nothing_asked, read_source
from nvscope.capture.datalogger.names import PREFIX, closed_files, number_of, title_of, told_of_closed
from nvscope.capture.formats import are_databases, why_no_row
from nvscope.cli.terminal import tell
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source, SourceInfo
    from nvscope.list_key import ListKey
    from nvscope.tracker.readings.readings import ReadValues


class VariablesRead(NamedTuple):
    """What the captures that were read say of themselves, and what their channels are called."""

    infos: Sequence[SourceInfo]
    channels: Sequence[str]

    @classmethod
    def of(cls, source: Source) -> VariablesRead:
        return cls(source.infos, source.channels)


class VariablesAsked(Struct, frozen=True):
    """What was asked of which captures, and how it is to be told."""

    inquiry: Inquiry
    wanted: str | None
    as_json: bool
    utc: bool
    quiet: bool
    colour: bool
    names: Mapping[str, str]
    wide: bool
    secrets: bool = False

    @property
    def nothing_defined(self) -> UsageError | None:
        """The error that no list with variables is defined, None where one is; pages need none."""
        if self.inquiry.layouts is not None:
            return None
        if not self.inquiry.project.files:
            what = "no page of a web visualization asked for variables"
            if self.wanted is not None:
                what = "the filter chooses no reply to a page of a web visualization that has a value"
            return UsageError(
                f"no definition is given, and {what}",
                next_step="name the exported list and its types with --gvl FILE or in nvscope.toml, or propose a "
                "layout with --infer",
            )
        return self.inquiry.nothing_defined()

    def nothing_of(
        self, listed: str | None, read: Sequence[ReadValues], infos: Sequence[SourceInfo] = ()
    ) -> UsageError | None:
        """Return the error that there is nothing of what was asked for, where nobody told a value of it.

        ``infos`` are those of what was read.
        """
        if are_databases(infos) and self.inquiry.layouts is None and not any(one.known for one in read):
            where = " between these times" if self.inquiry.asked else ""
            what = why_no_row(infos)
            if not where and len(infos) == 1 and infos[0].truncation is not None:
                what += f": {infos[0].truncation.message}"
            next_step = "`nvscope audit FILE.db` tells what is in it"
            if where:
                next_step = "leave --from-time and --to-time out"
            elif len(infos) == 1 and number_of(infos[0].path) is None and (closed := closed_files(infos[0].path)):
                next_step = told_of_closed(closed)
            return UsageError(f"{what}{where}", next_step=next_step)
        if listed is not None and read_source(listed):
            return nothing_asked(listed, [variable for one in read for variable in one.known])
        return self.nothing_defined

    def keys(self, listed: str | None) -> Collection[ListKey] | None:
        """Return the keys of the lists of a name, None for all; UsageError where there is none."""
        if read_source(listed):
            return ()
        if listed is None and self.inquiry.layouts is None:
            return None
        if self.inquiry.layouts is None and listed is not None:
            titles = [title_of(path) for path in self.inquiry.paths]
            if (title := f"{PREFIX}{listed.strip()}") in titles:
                raise UsageError(f"no list is called {listed.strip()}", next_step=f"the database is --list {title}")
        layouts = self.inquiry.defined_layouts()
        if listed is None:
            return None
        from nvscope.definition.selection import lists_named, names_of_lists

        return {key for key, _ in lists_named(names_of_lists(layouts), listed, layouts.unplaced)}

    def tell(self, document: Mapping[str, Any], render: Callable[[Mapping[str, Any]], str]) -> None:
        """Print a document as JSON, or as ``render`` makes it."""
        tell(document, render, as_json=self.as_json, colour=self.colour)
