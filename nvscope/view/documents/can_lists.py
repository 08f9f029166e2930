"""Lists and buses of CAN as data: what ``nvscope.report/2`` says of them.

A frame names neither sender nor reader, and carries no counter: what cannot be known is None.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from dissectors.can.canopen import title_of
from dissectors.can.pdo import EXTENDED
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.canopen import NO_EVIDENCE, Evidence
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.measured import Measured
from nvscope.tracker.subjects import Measures
from nvscope.units import cob_id
from nvscope.view.documents.drawn import Drawn, Part, fields, lists
from nvscope.view.documents.figures import (
    COUNTED_OF_LIST,
    COUNTED_OF_STREAM,
    PACE_OF_LIST,
    PACE_OF_STREAM,
    REMOTE_OF_STREAM,
    TELEGRAMS_OF_STREAM,
)
from nvscope.view.documents.measured_row import MeasuredRow, of_measured, with_values
from nvscope.view.documents.verdicts import Verdicts


def canopen_label(
    entry: CanListSummary, number: int, canopen: Mapping[str, Evidence], *, defined: bool
) -> str | None:  # fmt: skip
    """Return what CANopen's predefined set uses a COB-ID of a list for, such as ``heartbeat node 5``.

    None where it has none, where nothing on the channel shows that it is CANopen's, or where the list is ``defined``.
    """
    seen = canopen.get(str(entry.key.port), NO_EVIDENCE)
    return title_of(number) if not defined and not entry.extended and seen.of_cob_id(number) else None


class _StreamRow(MeasuredRow):
    """A COB-ID of a list."""

    __slots__ = ("measures", "stream")

    def __init__(self, measures: Measures, stream: CanStreamSummary) -> None:
        super().__init__()
        self.measures, self.stream = measures, stream

    def measure(self) -> Measured:
        return self.measures.of_stream(self.stream)

    PARTS: ClassVar[Sequence[Part]] = (
        fields(
            node=lambda _: None,
            subindex=lambda row: row.stream.subindex,
            cob_id=lambda row: row.stream.cob_id,
            extended=lambda row: row.stream.extended,
        ),
        of_measured(TELEGRAMS_OF_STREAM),
        of_measured(REMOTE_OF_STREAM),
        fields(counter_scope=lambda _: None),
        of_measured(COUNTED_OF_STREAM),
        fields(
            items=lambda _: None,
            length=lambda row: row.stream.length,
            checksum=lambda _: None,
        ),
        of_measured(PACE_OF_STREAM),
    )


class CanListRow(MeasuredRow):
    """A list on CAN, with its COB-IDs as streams; ``names`` are those of defined lists, "" of one without.

    ``key`` is the text of its key. ``canopen`` is of which nodes there is evidence, by channel.
    """

    __slots__ = ("canopen", "entry", "judged", "key", "measures", "name", "values_of")

    def __init__(
        self, entry: CanListSummary, key: str, names: Mapping[ListKey, str], measures: Measures,
        values: Mapping[ListKey, list[dict[str, Any]]] | None, canopen: Mapping[str, Evidence], judged: Verdicts,
    ) -> None:  # fmt: skip
        super().__init__()
        self.key = key
        self.entry, self.measures, self.values_of, self.canopen = entry, measures, values, canopen
        self.judged = judged
        self.name = told_of(names, entry.key) if names else None

    def measure(self) -> Measured:
        return self.measures.of_list(self.entry)

    def streams(self) -> Drawn[_StreamRow]:
        measures = self.measures
        return Drawn(self.entry.streams, lambda stream: _StreamRow(measures, stream))

    def label(self) -> str | None:
        return canopen_label(self.entry, self.entry.key.identifier, self.canopen, defined=self.name is not None)

    PARTS: ClassVar[Sequence[Part]] = (
        fields(
            key=lambda row: row.key,
            transport=lambda row: row.entry.key.transport.value,
            channel=lambda row: row.entry.key.port,
            id=lambda row: row.entry.key.identifier & ~EXTENDED,
            cob_id=lambda row: cob_id(row.entry.key.identifier & ~EXTENDED, row.entry.extended),
            name=lambda row: row.name or None,
            status=lambda row: row.judged.status(row.key),
            canopen=lambda row: row.label(),
            senders=lambda _: [],
            readers=lambda _: [],
        ),
        of_measured(COUNTED_OF_LIST),
        lists(nodes=lambda _: [], streams=lambda row: row.streams()),
        of_measured(PACE_OF_LIST),
    )


class ValuedCanListRow(CanListRow):
    """The same with its variables."""

    __slots__ = ()
    PARTS: ClassVar = with_values(CanListRow.PARTS)
