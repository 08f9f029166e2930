"""Comparisons: the variables that several lists have, and those that pages show of lists, observed and told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from nvscope.definition.layouts import Layouts
from nvscope.engine.run import Observer
from nvscope.tracker.variables.hops import Hops
from nvscope.tracker.visu.page_hops import PageHops
from nvscope.view.documents.hops import hop_rows


@dataclass(frozen=True)
class Comparisons:
    """Between lists (``hops``), and between pages and lists (``page_hops``)."""

    hops: Hops
    page_hops: PageHops

    @classmethod
    def by(cls, layouts: Layouts) -> Comparisons:
        """Return comparisons of the variables of defined lists, of which nothing was seen yet."""
        return cls(Hops(layouts), PageHops(layouts))

    @property
    def observers(self) -> Sequence[Observer]:
        """What has to observe for them."""
        return self.hops, self.page_hops

    def document(self, end_ns: int | None, *, secrets: bool) -> dict[str, Any]:
        """Return what a report says of them, up to the end of the capture; passwords are hidden without ``secrets``."""
        told: dict[str, Any] = {"hops": hop_rows(self.hops, end_ns), "hops_of_other_types": self.hops.untyped}
        if any(True for _ in self.page_hops.pairs):
            from nvscope.view.documents.page_hops import page_hop_rows  # noqa: PLC0415

            told["page_hops"] = page_hop_rows(self.page_hops, end_ns, secrets=secrets)
        return told
