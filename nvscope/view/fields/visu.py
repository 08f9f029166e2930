"""The fields of WebVisu messages: ``visu.kind``, ``visu.variables``, ``visu.latency``.

They are of the frame with which a message was whole; where that is true of several, of the first of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.expression.typed_columns import AddressColumn, FieldType, Numbers, TextColumn
from nvscope.tracker.visu.messages import Kind, Outcome, VisuBatch
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.visu_variable import variable_field

NAME = "visu"
_KINDS = tuple(kind.name.lower() for kind in Kind)
_OUTCOMES = tuple(outcome.name.lower() for outcome in Outcome if outcome is not Outcome.NONE)


def _first(part: VisuBatch, name: str) -> I64:
    column: I64 = getattr(part.messages, name)[part.first]
    return column


def _column(name: str) -> Callable[[VisuBatch], Numbers]:
    return lambda part: _first(part, name)


def _known(name: str) -> Callable[[VisuBatch], Bool]:
    return lambda part: _first(part, name) >= 0


def _is_reply(part: VisuBatch) -> Bool:
    own: Bool = _first(part, "kind") == Kind.REPLY
    return own


def _has_request(part: VisuBatch) -> Bool:
    own: Bool = (_first(part, "asked_frame") > 0) & (_first(part, "kind") < Kind.OTHER_BYTES)
    return own


def _asks_whole(part: VisuBatch) -> Bool:
    whole = np.array([not one.is_part for one in part.requests] + [False], np.bool_)
    own: Bool = whole[_first(part, "asked")]
    return own


def _end(part: VisuBatch, end: int) -> AddressColumn:
    pair = _first(part, "pair")
    high, low = (np.array(part.pairs[word], np.uint64)[pair] for word in (2 * end, 2 * end + 1))
    return AddressColumn(high, low)


def _of_requests(read: Callable[[VisuBatch], Sequence[int]]) -> Callable[[VisuBatch], Numbers]:
    def column(part: VisuBatch) -> Numbers:
        numbers = np.append(np.array(read(part), np.int64), 0)
        told: Numbers = numbers[_first(part, "asked")]
        return told

    return column


def _port(part: VisuBatch) -> Numbers:
    ports: U64 = np.array(part.pairs[4], np.uint64)[_first(part, "pair")]
    return ports


VISU_FIELDS: Sequence[TelegramField] = (
    TelegramField(
        "visu.kind", FieldType.TEXT, "Kind", "what it is", lambda part: TextColumn(_first(part, "kind"), _KINDS),
        of=NAME, texts=_KINDS,
    ),
    TelegramField("visu.client", FieldType.ADDRESS, "Client", "who asks", lambda part: _end(part, 0), of=NAME),
    TelegramField("visu.server", FieldType.ADDRESS, "Server", "who answers", lambda part: _end(part, 1), of=NAME),
    TelegramField("visu.port", FieldType.UNSIGNED, "Port", "of the server", _port, of=NAME),
    TelegramField(
        "visu.messages", FieldType.UNSIGNED, "Messages", "that are whole with this frame", lambda part: part.count,
        of=NAME,
    ),
    TelegramField(
        "visu.declared", FieldType.UNSIGNED, "Declared", "how many variables the request says it has",
        _of_requests(lambda part: [min(one.declared, 2**62) for one in part.requests]), _asks_whole, of=NAME,
    ),
    TelegramField(
        "visu.variables", FieldType.UNSIGNED, "Variables", "that are asked for, or written",
        _of_requests(lambda part: [len(one.entries) for one in part.requests]), _asks_whole, of=NAME,
    ),
    variable_field(),
    TelegramField(
        "visu.status", FieldType.UNSIGNED, "Status", "of the HTTP response", _column("status"), _known("status"),
        of=NAME,
    ),
    TelegramField(
        "visu.outcome", FieldType.TEXT, "Outcome", "what the reply says",
        lambda part: TextColumn(np.maximum(_first(part, "outcome"), 0), _OUTCOMES), _known("outcome"), of=NAME,
        texts=_OUTCOMES,
    ),
    TelegramField(
        "visu.latency", FieldType.DURATION, "Latency", "from the request to its reply", _column("latency_ns"),
        _is_reply, of=NAME,
    ),
    TelegramField(
        "visu.request_frame", FieldType.UNSIGNED, "Request", "frame of the request", _column("asked_frame"),
        _has_request, of=NAME,
    ),
)  # fmt: skip
