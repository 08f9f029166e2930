"""Comparisons: the variables that several lists have, and those that pages show or databases have of lists."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from nvscope.definition.layouts import Layouts
from nvscope.definition.selection import lists_named, names_of_lists
from nvscope.engine.run import Observer
from nvscope.errors import UsageError
from nvscope.tracker.datalogger.likeness import DatabaseLikeness
from nvscope.tracker.readings.read_hops import ReadHops
from nvscope.tracker.variables.hops import Hops
from nvscope.tracker.visu.page_likeness import PageLikeness
from nvscope.view.documents.hops import hop_rows

if TYPE_CHECKING:
    from nvscope.definition.project import Project


class Comparisons(Struct, frozen=True):
    """Between lists (``hops``), between pages and lists, and between databases and lists (``logged_hops``)."""

    hops: Hops
    page_hops: ReadHops
    logged_hops: ReadHops

    @classmethod
    def by(cls, layouts: Layouts, project: Project) -> Comparisons:
        """Return comparisons of the variables of defined lists, of which nothing was seen yet."""
        likeness = DatabaseLikeness(dict(_given(layouts, project.datalogger.variables)))
        return cls(Hops(layouts), ReadHops(layouts, PageLikeness()), ReadHops(layouts, likeness))

    @property
    def observers(self) -> Sequence[Observer]:
        """What has to observe for them."""
        return self.hops, self.page_hops, self.logged_hops

    def document(self, end_ns: int | None, *, secrets: bool) -> dict[str, Any]:
        """Return what a report says of them, up to the end of the capture; passwords are hidden without ``secrets``."""
        told: dict[str, Any] = {"hops": hop_rows(self.hops, end_ns), "hops_of_other_types": self.hops.untyped}
        for key, hops in (("page_hops", self.page_hops), ("logged_hops", self.logged_hops)):
            if any(True for _ in hops.pairs):
                from nvscope.view.documents.read_hops import read_hop_rows  # noqa: PLC0415

                told[key] = read_hop_rows(hops, end_ns, secrets=secrets)
        return told


def _given(layouts: Layouts, variables: Sequence[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Yield full names with what the project says they are: the name of a list, a point, and that of its variable."""
    for full, given in variables:
        listed, colon, name = given.rpartition(":")
        if not colon:
            yield full, given
            continue
        try:
            found = lists_named(names_of_lists(layouts), listed, layouts.unplaced)
        except UsageError:
            continue
        for _, known in found:
            yield full, f"{known.name}.{name}"
