"""The variables of a capture as data: last value, time, changes and bounds (schema ``nvscope.vars/1``)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from msgspec import Struct

from nvscope.definition.value import value_of
from nvscope.definition.variables import type_text
from nvscope.list_key import ListKey
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import StreamValues, Values
from nvscope.version import head
from nvscope.view.value_texts import json_value, unit_of, value_text

DOCUMENTED, ASSUMED = "documented", "assumed"
"""How sure it is which bytes a variable has: nothing documents how lists are packed on CAN."""

ReadRows = Mapping[str, Sequence[Mapping[str, Any]]]
"""Rows of variables whose values come one by one, by the key that they have in documents."""


def variables_document(
    state: TrackerState,
    values: Values | None,
    *,
    keys: Collection[ListKey] | None = None,
    expression: str | None = None,
    missing: Sequence[Mapping[str, Any]] = (),
    read_ones: ReadRows = MappingProxyType({}),
) -> dict[str, Any]:
    """Return the variables of all streams as data, by list, SubIndex and sender; ``keys`` are the lists, as their
    definition has them, None for all. ``read_ones`` are rows of variables whose values come one by one.

    Numbers are numbers (``null`` where they are not finite), times of the type as numbers in its unit, bytes as
    hexadecimal text; absolute times are nanoseconds as decimal strings. ``earlier`` are the variables of telegrams with
    a layout that another one of the list's definitions took the place of, up to their last telegram. ``expression`` is
    that of the filter; ``missing`` are rows of what is missing of what is defined.
    """
    streams = [
        stream
        for stream in (streams_of(state, values) if values else ())
        if keys is None or (values and values.layouts.key_of(stream.list) in keys)
    ]
    return {
        **head("nvscope.vars/1"),
        "filter": filter_told(expression, state.capture.chosen, state.capture.telegrams + state.buses.frames),
        "missing": list(missing),
        "variables": [row for stream in streams for row in _listed(stream, stream.sequence[-1])],
        "earlier": [row for stream in streams for known in stream.sequence[:-1] for row in _listed(stream, known)],
        **{key: list(told) for key, told in read_ones.items() if told},
    }


def filter_told(expression: str | None, chosen: int, telegrams: int) -> dict[str, Any] | None:
    """Return a filter as data, with how many of all telegrams it chooses; None where there is none."""
    if expression is None:
        return None
    return {"expression": expression, "telegrams": chosen, "all_telegrams": telegrams}


def values_by_list(state: TrackerState, values: Values) -> dict[ListKey, list[dict[str, Any]]]:
    """Return the rows of ``variables_document`` without what they have of their list, by its key."""
    found: dict[ListKey, list[dict[str, Any]]] = {}
    for stream in streams_of(state, values):
        rows = _rows(stream.subindex, stream.sender, stream.sequence[-1])
        found.setdefault(stream.list, []).extend(rows)
    return found


class VariableStream(Struct, frozen=True):
    """Whose values: key of the list, SubIndex, sender, and what each of its layouts gave."""

    list: ListKey
    subindex: int
    sender: str
    sequence: Sequence[StreamValues]


def streams_of(state: TrackerState, values: Values) -> list[VariableStream]:
    """Return the streams in the order of their rows."""
    entries = []
    for stream in values.streams:
        key = state.keys.stream_key(stream)
        order = key.list, key.subindex, key.order
        entries.append((order, VariableStream(key.list, key.subindex, key.sender, values.sequence(stream))))
    return [stream for _, stream in sorted(entries, key=lambda entry: entry[0])]


class LeftOut(NamedTuple):
    """How many telegrams of defined lists could not be decoded.

    ``unfitting`` have another shape than their definition; ``unlike_known_part`` than what is known of it, where an
    element has no known size; ``truncated`` were not captured whole.
    """

    unfitting: int
    unlike_known_part: int
    truncated: int


def left_out(state: TrackerState, values: Values, keys: Collection[ListKey] | None = None) -> LeftOut:
    """Return how many telegrams of defined lists could not be decoded.

    ``keys`` are those of the lists that are looked at, as their definition has them, None for all.
    """
    keys_seen = state.keys
    listed = (values.layouts.key_of(keys_seen.list_key(number)) for number in range(len(keys_seen.lists)))
    defined = np.array([key is not None and (keys is None or key in keys) for key in listed], np.bool_)
    count = values.unfitting.column("count")
    lists = keys_seen.list_of_place(keys_seen.place_of(np.arange(len(count))))
    partly = np.array([bool(values.layouts.partly_of(key)) for key in map(keys_seen.list_key, range(len(defined)))])
    wanted, of_known_part = defined[lists], partly.astype(np.bool_)[lists]
    return LeftOut(
        int(count[wanted & ~of_known_part].sum()),
        int(count[wanted & of_known_part].sum()),
        int(state.lists.columns.truncated[: len(defined)][defined].sum()),
    )


def _listed(stream: VariableStream, known: StreamValues) -> list[dict[str, Any]]:
    listed = {"list": str(stream.list), "list_name": known.layout.list.name}
    return [{**listed, **row} for row in _rows(stream.subindex, stream.sender, known)]


def _rows(subindex: int, sender: str, known: StreamValues) -> list[dict[str, Any]]:
    rows = []
    bounds = _bounds(known)
    for place, (offset, element) in enumerate(known.layout.spans()):
        raw = known.data[offset : offset + element.type.size_bytes].tobytes()
        least, most = bounds[place]
        rows.append(
            {
                "name": element.name,
                "type": type_text(element.type),
                "sender": sender,
                "packing": ASSUMED if known.layout.list.on_can else DOCUMENTED,
                "subindex": subindex,
                "unit": unit_of(element.type),
                "value": json_value(element.type, value_of(element.type, raw)),
                "text": value_text(element.type, raw),
                "last_ns": str(known.last_ns),
                "changed_ns": str(int(known.changed_ns[place])),
                "telegrams": known.telegrams,
                "changes": int(known.changes[place]),
                "min": None if least is None else json_value(element.type, value_of(element.type, least)),
                "max": None if most is None else json_value(element.type, value_of(element.type, most)),
                "min_text": None if least is None else value_text(element.type, least),
                "max_text": None if most is None else value_text(element.type, most),
            }
        )
    return rows


def _bounds(known: StreamValues) -> list[tuple[bytes | None, bytes | None]]:
    """Return the bytes of the least and the greatest value of each element; None for what has no order."""
    bounds: list[tuple[bytes | None, bytes | None]] = []
    for block, least, most in zip(known.blocks, known.least, known.most, strict=True):
        if least is None or most is None:
            bounds += [(None, None)] * block.count
        else:
            bounds += [(low.tobytes(), high.tobytes()) for low, high in zip(least, most, strict=True)]
    return bounds
