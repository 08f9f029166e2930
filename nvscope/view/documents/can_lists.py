"""Lists and buses of CAN as data: what ``nvscope.report/1`` says of them.

A frame names neither sender nor reader, and carries no counter: what cannot be known is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dissectors.can.canopen import title_of
from dissectors.can.pdo import EXTENDED
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.can.canopen import NO_EVIDENCE, Evidence
from nvscope.tracker.can.summary import CanListSummary, CanStreamSummary
from nvscope.tracker.subjects import Measures
from nvscope.units import cob_id
from nvscope.view.documents.figures import (
    COUNTED_OF_LIST,
    COUNTED_OF_STREAM,
    PACE_OF_LIST,
    PACE_OF_STREAM,
    REMOTE_OF_STREAM,
    TELEGRAMS_OF_STREAM,
)


def can_list(
    entry: CanListSummary,
    names: Mapping[ListKey, str],
    measures: Measures,
    values: Mapping[str, Any],
    canopen: Mapping[str, Evidence],
) -> dict[str, Any]:
    """Return a list on CAN, with its COB-IDs as streams; ``names`` are those of defined lists, "" of one without.

    ``values`` is what is told of its variables, ``canopen`` of which nodes there is evidence, by channel.
    """
    name, measured = told_of(names, entry.key), measures.of_list(entry)
    return {
        "key": str(entry.key),
        "transport": entry.key.transport.value,
        "channel": entry.key.port,
        "id": entry.key.identifier & ~EXTENDED,
        "name": name or None,
        "cob_id": cob_id(entry.key.identifier & ~EXTENDED, entry.extended),
        "canopen": canopen_label(entry, entry.key.identifier, canopen, defined=name is not None),
        "senders": [],
        "readers": [],
        **COUNTED_OF_LIST.read(measured),
        "nodes": [],
        "streams": [_stream(stream, measures) for stream in entry.streams],
        **values,
        **PACE_OF_LIST.read(measured),
    }


def canopen_label(
    entry: CanListSummary, number: int, canopen: Mapping[str, Evidence], *, defined: bool
) -> str | None:  # fmt: skip
    """Return what CANopen's predefined set uses a COB-ID of a list for, such as ``heartbeat node 5``.

    None where it has none, where nothing on the channel shows that it is CANopen's, or where the list is ``defined``.
    """
    seen = canopen.get(str(entry.key.port), NO_EVIDENCE)
    return title_of(number) if not defined and not entry.extended and seen.of_cob_id(number) else None


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
