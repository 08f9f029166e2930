"""The fields of WebVisu messages: ``visu.kind``, ``visu.variables``, ``visu.latency``.

They are of the frame with which a message was whole; where that is true of several, it has them of each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.expression.typed_columns import AddressColumn, FieldType, Numbers, TextColumn
from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind, Outcome, VisuBatch
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame_messages import message_field
from nvscope.view.fields.visu_variable import index_field, value_field, variable_field

NAME = "visu"
_OF_BYTES = (Kind.OTHER_BYTES, Kind.OTHER_REPLY_BYTES, Kind.HIDDEN, Kind.REPLY_GAP)
_KINDS = tuple(kind.name.lower() for kind in Kind)
_OUTCOMES = tuple(outcome.name.lower() for outcome in Outcome if outcome is not Outcome.NONE)


def _of(part: VisuBatch, at: I64, name: str) -> I64:
    column: I64 = getattr(part.messages, name)[at]
    return column


def _column(name: str) -> Callable[[VisuBatch, I64], Numbers]:
    return lambda part, at: _of(part, at, name)


def _known(name: str) -> Callable[[VisuBatch, I64], Bool]:
    return lambda part, at: _of(part, at, name) >= 0


def _is_reply(part: VisuBatch, at: I64) -> Bool:
    own: Bool = _of(part, at, "kind") == Kind.REPLY
    return own


def _is_measured(part: VisuBatch, at: I64) -> Bool:
    own: Bool = _is_reply(part, at) & (_of(part, at, "latency_ns") != UNMEASURED_NS)
    return own


def _has_request(part: VisuBatch, at: I64) -> Bool:
    own: Bool = (_of(part, at, "asked_frame") > 0) & ~np.isin(_of(part, at, "kind"), _OF_BYTES)
    return own


def _asks_whole(part: VisuBatch, at: I64) -> Bool:
    whole = np.array([not one.is_part for one in part.requests] + [False], np.bool_)
    own: Bool = whole[_of(part, at, "asked")]
    return own


def _end(part: VisuBatch, at: I64, end: int) -> AddressColumn:
    pair = _of(part, at, "pair")
    high, low = (np.array(part.pairs[word], np.uint64)[pair] for word in (2 * end, 2 * end + 1))
    return AddressColumn(high, low)


def _of_requests(read: Callable[[VisuBatch], Sequence[int]]) -> Callable[[VisuBatch, I64], Numbers]:
    def column(part: VisuBatch, at: I64) -> Numbers:
        numbers = np.append(np.array(read(part), np.int64), 0)
        told: Numbers = numbers[_of(part, at, "asked")]
        return told

    return column


def _port(part: VisuBatch, at: I64) -> Numbers:
    ports: U64 = np.array(part.pairs[4], np.uint64)[_of(part, at, "pair")]
    return ports


VISU_FIELDS: Sequence[TelegramField] = (
    message_field(
        "visu.kind", FieldType.TEXT, "Kind", "what it is", lambda part, at: TextColumn(_of(part, at, "kind"), _KINDS),
        of=NAME, texts=_KINDS,
    ),
    message_field(
        "visu.client", FieldType.ADDRESS, "Client", "who asks", lambda part, at: _end(part, at, 0), of=NAME, once=True
    ),
    message_field(
        "visu.server", FieldType.ADDRESS, "Server", "who answers", lambda part, at: _end(part, at, 1), of=NAME,
        once=True,
    ),
    message_field("visu.port", FieldType.UNSIGNED, "Port", "of the server", _port, of=NAME, once=True),
    TelegramField(
        "visu.messages", FieldType.UNSIGNED, "Messages", "that are whole with this frame", lambda part: part.count,
        of=NAME,
    ),
    message_field(
        "visu.declared", FieldType.UNSIGNED, "Declared", "how many variables the request says it has",
        _of_requests(lambda part: [min(one.declared, 2**62) for one in part.requests]), _asks_whole, of=NAME,
    ),
    message_field(
        "visu.variables", FieldType.UNSIGNED, "Variables", "that are asked for, or written",
        _of_requests(lambda part: [len(one.entries) for one in part.requests]), _asks_whole, of=NAME,
    ),
    variable_field(),
    index_field(),
    value_field(),
    message_field(
        "visu.status", FieldType.UNSIGNED, "Status", "of the HTTP response", _column("status"), _known("status"),
        of=NAME,
    ),
    message_field(
        "visu.outcome", FieldType.TEXT, "Outcome", "what the reply says",
        lambda part, at: TextColumn(np.maximum(_of(part, at, "outcome"), 0), _OUTCOMES), _known("outcome"), of=NAME,
        texts=_OUTCOMES,
    ),
    message_field(
        "visu.latency", FieldType.DURATION, "Latency", "from the request to its reply", _column("latency_ns"),
        _is_measured, of=NAME,
    ),
    message_field(
        "visu.request_frame", FieldType.UNSIGNED, "Request", "frame of the request", _column("asked_frame"),
        _has_request, of=NAME,
    ),
)  # fmt: skip


def visu_fields(*, secrets: bool) -> Sequence[TelegramField]:
    """Return the fields; with ``secrets``, values have passwords in clear."""
    return [value_field(secrets=secrets) if one.name == "visu.value" else one for one in VISU_FIELDS]
