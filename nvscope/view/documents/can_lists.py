"""Lists and buses of CAN as data: what ``nvscope.report/1`` says of them.

A frame names neither sender nor reader, and carries no counter: what cannot be known is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dissectors.can.canopen import title_of
from dissectors.can.pdo import EXTENDED
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.subjects import Measures
from nvscope.view.documents.figures import (
    COUNTED_OF_LIST,
    COUNTED_OF_STREAM,
    PACE_OF_LIST,
    PACE_OF_STREAM,
    REMOTE_OF_STREAM,
    TELEGRAMS_OF_STREAM,
)


def can_list(
    entry: CanListSummary, names: Mapping[ListKey, str], measures: Measures, values: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a list on CAN, with its COB-IDs as streams; ``names`` are those of defined lists, "" of one without.

    ``values`` is what is told of its variables.
    """
    name, measured = told_of(names, entry.key), measures.of_list(entry)
    return {
        "key": str(entry.key),
        "transport": entry.key.transport.value,
        "channel": entry.key.port,
        "id": entry.key.identifier & ~EXTENDED,
        "name": name or None,
        "canopen": canopen_label(entry, entry.key.identifier, defined=name is not None),
        "senders": [],
        "readers": [],
        **COUNTED_OF_LIST.read(measured),
        "nodes": [],
        "streams": [_stream(stream, measures) for stream in entry.streams],
        **values,
        **PACE_OF_LIST.read(measured),
    }


def canopen_label(entry: CanListSummary, cob_id: int, *, defined: bool) -> str | None:
    """Return what CANopen's predefined set uses a COB-ID of a list for, such as ``heartbeat node 5``.

    None where it has none, or where the list is ``defined``.
    """
    return None if defined or entry.extended else title_of(cob_id) or None


def _stream(stream: CanStreamSummary, measures: Measures) -> dict[str, Any]:
    measured = measures.of_stream(stream)
    return {
        "node": None,
        "subindex": stream.subindex,
        "cob_id": stream.cob_id,
        "extended": stream.extended,
        **TELEGRAMS_OF_STREAM.read(measured),
        **REMOTE_OF_STREAM.read(measured),
        "counter_scope": None,
        **COUNTED_OF_STREAM.read(measured),
        "items": None,
        "length": stream.length,
        "checksum": None,
        **PACE_OF_STREAM.read(measured),
    }
