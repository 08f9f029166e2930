"""What people call the parameters that telegrams of the Parameter Manager are about, and the values in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors import address
from dissectors.netvar import HEADER, PARAMETER_REQUESTS, Fault, Service, TelegramBatch
from nvscope.view.documents.parameter_values import ParameterValues

if TYPE_CHECKING:  # without a project, nothing of definitions is imported
    from nvscope.definition.parameters import ParameterDefinition, Parameters


WITH_VALUE = (Service.ODWriteRequest, Service.ODReadRequestReply)
"""Services of telegrams that carry the value of a parameter."""


def parameter_of(parameters: Parameters | None, telegrams: TelegramBatch, row: int) -> ParameterDefinition | None:
    """Return what is known of the parameter that a telegram asks for, or answers about; None without anything.

    It is one of the node that is asked.
    """
    if not parameters:
        return None
    header, datagram = telegrams.header[row], telegrams.datagram
    high, low = (
        (datagram.destination_hi, datagram.destination_lo)
        if header["id"] in PARAMETER_REQUESTS
        else (datagram.source_hi, datagram.source_lo)
    )
    node = address.text(int(high[row]), int(low[row]))
    return parameters.of(node, int(header["index"]), int(header["subindex"]))


def value_text(
    parameters: Parameters | None, values: ParameterValues, telegrams: TelegramBatch, row: int
) -> str:  # fmt: skip
    """Return the value in a telegram that carries one, by the type of the project, or its bytes; '' for none.

    Of a telegram that contradicts itself, or was cut off in front of its value, nobody knows it.
    """
    datagram, header = telegrams.datagram, telegrams.header[row]
    size_bytes = int(header["length"]) - HEADER.size_bytes
    captured_bytes = min(int(datagram.captured_bytes[row]) - HEADER.size_bytes, size_bytes)
    if telegrams.fault[row] != Fault.NONE or (size_bytes > 0 and captured_bytes <= 0):
        return ""
    start = int(datagram.payload[row]) + HEADER.size_bytes
    data = telegrams.data[start : start + captured_bytes].tobytes()
    return values.told(parameter_of(parameters, telegrams, row), data, int(header["items"]), size_bytes)[1]
