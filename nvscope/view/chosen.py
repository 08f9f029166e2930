"""What a display filter leaves of a report: rows of it, none of them changed.

A filter chooses telegrams. What is shown is what they belong to: their lists, their streams, their senders and
receivers, and the findings on these. The figures are those of all telegrams: acknowledgements that a filter hides were
sent all the same, and a Counter that runs over several lists has no gap because one of them is shown alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from nvscope.causes.cause import Cause
from nvscope.findings.finding import Finding
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.view.display_filter import DisplayFilter

_Place = tuple[int, int | None, int | None]


class Chosen:
    """What the telegrams belong to that the filter of a state chose; ``findings`` are all there are.

    Where a filter asks for findings, they are those that it was given, in the same order. Of the ``causes``, those are
    to be shown that explain one of the findings that are, or concern a list that is.
    """

    def __init__(
        self, state: TrackerState, chosen: DisplayFilter, findings: Sequence[Finding], causes: Sequence[Cause] = ()
    ) -> None:  # fmt: skip
        self._filter = chosen
        self.expression = chosen.text
        self._streams: set[int] = set()
        self._senders: set[int] = set()
        self._protocols = state.capture.chosen_protocols
        self._places: set[_Place] = set()
        for number, stream, sender, receiver, subindex in _flows(state):
            self._streams.add(stream)
            self._senders.add(sender)
            ends: tuple[int | None, ...] = (sender, receiver, None)
            self._places.update((number, node, part) for node in ends for part in (subindex, None))
        self.findings = [finding for number, finding in enumerate(findings) if self._shows(number, finding)]
        """Those that are to be shown."""
        self._lists = {finding.list_number for finding in self.findings} | {place[0] for place in self._places}
        shown = set(map(id, self.findings))
        keys = {state.keys.list_key(number) for number in self._lists if number is not None and number >= 0}
        self.causes = [
            cause for cause in causes
            if any(id(finding) in shown for finding in cause.findings)
            or (not chosen.findings and (cause.of_capture or not keys.isdisjoint(cause.lists)))
        ]  # fmt: skip
        """Those that are to be shown."""

    def _shows(self, number: int, finding: Finding) -> bool:
        if self._filter.findings:
            return self._filter.chooses_finding(number)
        if finding.kind.protocol:
            return finding.kind.protocol in self._protocols
        if finding.lists:
            return any(place[0] in finding.lists for place in self._places)
        if finding.list_number is not None:
            return (finding.list_number, finding.node, finding.subindex) in self._places
        return finding.node in self._senders or finding.kind.of_capture

    def summary(self, whole: Summary) -> Summary:
        """Return a summary with the lists, streams and nodes that are to be shown."""
        lists = [self._list(entry) for entry in whole.lists if entry.number in self._lists]
        on_can = [
            replace(entry, streams=[stream for stream in entry.streams if stream.stream in self._streams])
            for entry in whole.can.lists
            if entry.number in self._lists
        ]
        return replace(whole, lists=lists, can=replace(whole.can, lists=on_can))

    def _list(self, entry: ListSummary) -> ListSummary:
        return entry._replace(
            nodes=[row for row in entry.nodes if (entry.number, row[0], None) in self._places],
            streams=[stream for stream in entry.streams if stream.stream in self._streams],
        )


def _flows(state: TrackerState) -> Iterator[tuple[int, int, int, int, int]]:
    """Yield list, stream, source, destination and SubIndex of each flow with a chosen telegram; -1 for what is none."""
    columns, places = state.lists.flows, state.keys.places
    names = ("chosen", "list", "stream", "source", "destination", "place")
    for chosen, *ends, place in zip(*(columns.column(name).tolist() for name in names), strict=True):
        if chosen:
            yield *ends, int(places.low[place])
