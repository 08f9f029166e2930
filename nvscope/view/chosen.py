"""What a display filter leaves of a report: rows of it, none of them changed.

A filter chooses telegrams. What is shown is what they belong to: their lists, their streams, their senders and
receivers, and the findings on these. The figures are those of all telegrams: acknowledgements that a filter hides were
sent all the same, and a Counter that runs over several lists has no gap because one of them is shown alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from nvscope.causes.cause import Cause
from nvscope.findings.finding import Finding
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import ListSummary, Summary
from nvscope.view.display_filter import DisplayFilter

_Place = tuple[int, int | None, int | None]


class Chosen:
    """What the telegrams belong to that the filter of a state chose; ``findings`` are all there are.

    Where a filter asks for findings or causes, they are those that it was given, in the same order. Those with which it
    chose a telegram are to be shown: findings with the causes that explain them, causes with the findings that they
    explain; of a filter that asks for both, exactly these. Lists of causes that it asks for are shown too, whole where
    no telegram of one was chosen. Of a filter that asks for none, findings on what is shown are to be shown, and the
    ``causes`` that explain one of them or concern a list that is.
    """

    def __init__(
        self, state: TrackerState, chosen: DisplayFilter, findings: Sequence[Finding], causes: Sequence[Cause] = ()
    ) -> None:  # fmt: skip
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
        self._asks_for_shown = chosen.findings or chosen.causes
        found, happened = chosen.shown() if self._asks_for_shown else (set[int](), set[int]())
        self.findings = [
            finding for number, finding in enumerate(findings)
            if (number in found if self._asks_for_shown else self._shows(finding))
        ]  # fmt: skip
        """Those that are to be shown."""
        self._lists = {finding.list_number for finding in self.findings} | {place[0] for place in self._places}
        shown = set(map(id, self.findings))
        keys = {state.keys.list_key(number) for number in self._lists if number is not None and number >= 0}

        def shows(number: int, cause: Cause) -> bool:
            if chosen.causes:
                return number in happened
            explains = any(id(finding) in shown for finding in cause.findings)
            return explains or (not chosen.findings and (cause.of_capture or not keys.isdisjoint(cause.lists)))

        self.causes = [cause for number, cause in enumerate(causes) if shows(number, cause)]
        """Those that are to be shown."""
        named = {key for cause in self.causes for key in cause.lists} if chosen.causes else set()
        self._whole = named - {state.keys.list_key(place[0]) for place in self._places if place[0] >= 0}
        """Lists that a cause concerns which was asked for, and of which no telegram was chosen."""

    def _shows(self, finding: Finding) -> bool:
        if finding.kind.protocol:
            return finding.kind.protocol in self._protocols
        if finding.lists:
            return any(place[0] in finding.lists for place in self._places)
        if finding.list_number is not None:
            return (finding.list_number, finding.node, finding.subindex) in self._places
        return finding.node in self._senders or finding.kind.of_capture

    def summary(self, whole: Summary) -> Summary:
        """Return a summary with the lists, streams and nodes that are to be shown."""
        lists = [self._list(entry) for entry in whole.lists if self._has(entry)]
        on_can = [self._list_on_can(entry) for entry in whole.can.lists if self._has(entry)]
        return replace(whole, lists=lists, can=replace(whole.can, lists=on_can))

    def _has(self, entry: ListSummary | CanListSummary) -> bool:
        return entry.number in self._lists or entry.key in self._whole

    def _list(self, entry: ListSummary) -> ListSummary:
        if entry.key in self._whole:
            return entry
        return entry._replace(
            nodes=[row for row in entry.nodes if (entry.number, row[0], None) in self._places],
            streams=[stream for stream in entry.streams if stream.stream in self._streams],
        )

    def _list_on_can(self, entry: CanListSummary) -> CanListSummary:
        if entry.key in self._whole:
            return entry
        return replace(entry, streams=[stream for stream in entry.streams if stream.stream in self._streams])


def _flows(state: TrackerState) -> Iterator[tuple[int, int, int, int, int]]:
    """Yield list, stream, source, destination and SubIndex of each flow with a chosen telegram; -1 for what is none."""
    columns, places = state.lists.flows, state.keys.places
    names = ("chosen", "list", "stream", "source", "destination", "place")
    for chosen, *ends, place in zip(*(columns.column(name).tolist() for name in names), strict=True):
        if chosen:
            yield *ends, int(places.low[place])
