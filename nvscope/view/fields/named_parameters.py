"""The fields of parameters that the project describes: ``sdo.name``, and ``sdo.text``, a value by its type."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors import address
from dissectors.batch import I64, Bool
from dissectors.keys import KeyTable
from dissectors.netvar import HEADER, PARAMETER_REQUESTS, Fault, Service, TelegramBatch
from nvscope.expression.typed_columns import FieldType, TextColumn
from nvscope.view.documents.parameter_values import ParameterValues, elements_told
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.parameter import have_parameter
from nvscope.view.rows.frames import NETVAR

if TYPE_CHECKING:
    from nvscope.definition.parameters import ParameterDefinition, Parameters

_WITH_VALUE = (Service.ODWriteRequest, Service.ODReadRequestReply)


def named_parameter_fields(parameters: Parameters | None) -> tuple[TelegramField, TelegramField]:
    """Return the fields of what a project says of parameters; without it, no telegram has them."""
    known = _Named(parameters)
    return (
        TelegramField(
            "sdo.name", FieldType.TEXT, "Parameter", "name of the parameter, from the project file", known.names,
            known.have_name, of=NETVAR, constant=True, any_case=True,
        ),
        TelegramField(
            "sdo.text", FieldType.TEXT, "Value", "what is written, or was read, by the type of the project file",
            known.values, known.have_value, of=NETVAR,
        ),
    )  # fmt: skip


class _Named:
    """Looks up the parameters that telegrams are about."""

    def __init__(self, parameters: Parameters | None) -> None:
        self._parameters = parameters
        self._values = ParameterValues()
        # Always set as one: threads that look at different telegrams do not mix them up.
        self._last: tuple[TelegramBatch, TextColumn, Bool] | None = None

    def names(self, telegrams: TelegramBatch) -> TextColumn:
        found, code = self._of(telegrams)
        return TextColumn(code, tuple(one.name if one else "" for one in found))

    def have_name(self, telegrams: TelegramBatch) -> Bool:
        found, code = self._of(telegrams)
        own: Bool = np.array([bool(one and one.name) for one in found], np.bool_)[code]
        return own

    def values(self, telegrams: TelegramBatch) -> TextColumn:
        return self._told(telegrams)[1]

    def have_value(self, telegrams: TelegramBatch) -> Bool:
        return self._told(telegrams)[2]

    def _told(self, telegrams: TelegramBatch) -> tuple[TelegramBatch, TextColumn, Bool]:
        """Return the values by their types, and which telegrams have one that fits; those of the last ones are kept."""
        last = self._last
        if last is None or last[0] is not telegrams:
            last = self._last = (telegrams, *self._found(telegrams))
        return last

    def _found(self, telegrams: TelegramBatch) -> tuple[TextColumn, Bool]:
        """Return the same; of equal values, one is told for all."""
        code, have = np.zeros(len(telegrams), np.int64), np.zeros(len(telegrams), np.bool_)
        texts: dict[str, int] = {"": 0}
        if self._parameters:
            found, number = self._of(telegrams)
            typed = np.array([bool(one and one.type) for one in found], np.bool_)[number]
            datagram, header = telegrams.datagram, telegrams.header
            typed &= np.isin(header["id"], _WITH_VALUE) & (telegrams.fault == Fault.NONE)
            typed &= datagram.captured_bytes >= datagram.payload_bytes
            known: dict[tuple[int, int, bytes], int | None] = {}
            for row in np.flatnonzero(typed).tolist():
                start = int(datagram.payload[row]) + HEADER.size_bytes
                data = telegrams.data[start : start + int(header["length"][row]) - HEADER.size_bytes].tobytes()
                key = int(number[row]), int(header["items"][row]), data
                if key not in known:
                    parameter = found[key[0]]
                    layout = self._values.layout(parameter, key[1], len(data)) if parameter else None
                    text = None if layout is None else elements_told(layout, data)[1]
                    known[key] = None if text is None else texts.setdefault(text, len(texts))
                told = known[key]
                if told is not None:
                    code[row], have[row] = told, True
        return TextColumn(code, tuple(texts)), have

    def _of(self, telegrams: TelegramBatch) -> tuple[list[ParameterDefinition | None], I64]:
        """Return the parameters that telegrams are about, None of what is not known, and which of them each is about.

        It is one of the node that is asked.
        """
        nothing: list[ParameterDefinition | None] = [None]
        code = np.zeros(len(telegrams), np.int64)
        own = np.flatnonzero(have_parameter(telegrams)) if self._parameters else code[:0]
        if not len(own) or self._parameters is None:
            return nothing, code
        datagram, header = telegrams.datagram, telegrams.header
        asks = np.isin(header["id"][own], PARAMETER_REQUESTS)
        high = np.where(asks, datagram.destination_hi[own], datagram.source_hi[own])
        low = np.where(asks, datagram.destination_lo[own], datagram.source_lo[own])
        place = header["index"][own].astype(np.uint64) << np.uint64(16) | header["subindex"][own].astype(np.uint64)
        keys = KeyTable(3)
        code[own] = keys.numbers(high, low, place) + 1
        nodes = zip(*(word.tolist() for word in keys.words), strict=True)
        found = [self._parameters.of(address.text(hi, lo), at >> 16, at & 0xFFFF) for hi, lo, at in nodes]
        return nothing + found, code
