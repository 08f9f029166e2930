"""What people call the parameters that telegrams of the Parameter Manager are about."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors import address
from dissectors.netvar import PARAMETER_REQUESTS, TelegramBatch

if TYPE_CHECKING:  # without a project, nothing of definitions is imported
    from nvscope.definition.parameters import ParameterDefinition, Parameters


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
