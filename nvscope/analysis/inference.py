"""Proposals for the layouts of lists without a definition."""

from __future__ import annotations

from msgspec import Struct

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.source import Source
from nvscope.list_key import Transport
from nvscope.tracker.variables.samples import Samples


class Inferred(Struct, frozen=True):
    """Samples of all streams, from which layouts are proposed, and the source that they were taken from."""

    samples: Samples
    source: Source

    @property
    def some_on_can(self) -> bool:
        """Whether lists on CAN were seen, of which nothing can be proposed."""
        return any(key.transport is Transport.CAN for key in self.samples.read.lists)


def infer(inquiry: Inquiry, *, expression: str | None = None) -> Inferred:
    """Take samples of the telegrams of all lists, or of those that a filter chooses."""
    chosen = None if expression is None else inquiry.filter(expression)
    source, samples = inquiry.open(), Samples()
    for _ in inquiry.run(source, [samples], chosen):
        pass
    return Inferred(samples, source)
