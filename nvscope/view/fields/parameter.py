"""The fields of telegrams of the Parameter Manager: ``sdo.index``, ``sdo.error``, ``sdo.value``.

They are read from the same header as those of lists (``nvscope.view.fields.netvar``), whose Index and SubIndex mean
something else here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dissectors.batch import Bool
from dissectors.netvar import HEADER, IS_PARAMETER, PARAMETER_ERRORS, PARAMETER_REQUESTS, Service, TelegramBatch
from nvscope.expression.typed_columns import BytesColumn, FieldType, Numbers, TextColumn
from nvscope.view.fields.field import TelegramField
from nvscope.view.rows.frames import NETVAR

_NAMES = ("", *(one.name for one in PARAMETER_ERRORS))


def _is_parameter(telegrams: TelegramBatch) -> Bool:
    code = np.minimum(telegrams.header["id"], len(IS_PARAMETER) - 1)
    own: Bool = IS_PARAMETER[code]
    return own


def _known_to(end: int) -> Callable[[TelegramBatch], Bool]:
    """Return what tells which telegrams are such, and were captured up to a byte of the payload."""
    return lambda telegrams: _is_parameter(telegrams) & (telegrams.datagram.captured_bytes >= end)


def _column(name: str) -> Callable[[TelegramBatch], Numbers]:
    return lambda telegrams: telegrams.header[name]


def _asks(telegrams: TelegramBatch) -> Bool:
    return np.isin(telegrams.header["id"], PARAMETER_REQUESTS)


def _writes(telegrams: TelegramBatch) -> Bool:
    return np.isin(telegrams.header["id"], (Service.ODWriteRequest, Service.ODWriteRequestReply))


def _error(telegrams: TelegramBatch) -> TextColumn:
    code = telegrams.header["id"].astype(np.int64) - int(PARAMETER_ERRORS[0]) + 1
    return TextColumn(np.where((code > 0) & (code < len(_NAMES)), code, 0), _NAMES)


def _is_error(telegrams: TelegramBatch) -> Bool:
    return np.isin(telegrams.header["id"], PARAMETER_ERRORS)


def _value(telegrams: TelegramBatch) -> BytesColumn:
    datagrams = telegrams.datagram
    stop = datagrams.payload + datagrams.captured_bytes
    return BytesColumn(telegrams.data, np.minimum(datagrams.payload + HEADER.size_bytes, stop), stop)


def _has_value(telegrams: TelegramBatch) -> Bool:
    own: Bool = _is_parameter(telegrams) & (telegrams.datagram.captured_bytes > HEADER.size_bytes)
    return own


have_parameter = _known_to(HEADER.offset_of("items"))
"""Tells which telegrams say which parameter they are about."""

PARAMETER_FIELDS: Sequence[TelegramField] = (
    TelegramField(
        "sdo", FieldType.BOOL, "Parameter Manager", "telegrams of the Parameter Manager", _is_parameter,
        of=NETVAR, constant=True,
    ),
    TelegramField(
        "sdo.index", FieldType.UNSIGNED, "Index", "of the parameter", _column("index"), have_parameter,
        of=NETVAR, hex_digits=4, constant=True,
    ),
    TelegramField(
        "sdo.subindex", FieldType.UNSIGNED, "SubIndex", "of the parameter", _column("subindex"), have_parameter,
        of=NETVAR, constant=True,
    ),
    TelegramField(
        "sdo.request", FieldType.BOOL, "Request", "it asks; else it answers", _asks, _is_parameter, of=NETVAR,
        constant=True,
    ),
    TelegramField(
        "sdo.write", FieldType.BOOL, "Write", "it writes a value, or says that one is written", _writes, _is_parameter,
        of=NETVAR, constant=True,
    ),
    TelegramField(
        "sdo.error", FieldType.TEXT, "Error", "how a request is refused", _error, _is_error, of=NETVAR, constant=True,
        texts=_NAMES[1:],
    ),
    TelegramField(
        "sdo.value", FieldType.BYTES, "Value", "what is written, or was read, as bytes", _value, _has_value, of=NETVAR,
    ),
)  # fmt: skip
