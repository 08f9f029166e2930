"""Reads and writes of a parameter over a link, from the first request to what came of it all."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from dissectors.netvar import Service
from nvscope.plc.parameter.conversation import Ending, Patience
from nvscope.plc.parameter.document import Parameter, is_misfit, may_be_written, read_document, write_document
from nvscope.plc.parameter.link import ParameterLink
from nvscope.plc.parameter.message import Message


def read(link: ParameterLink, parameter: Parameter, items: int, patience: Patience) -> dict[str, Any]:
    """Read a parameter of so many elements; return what came of it (schema ``nvscope.sdo/1``)."""
    return read_document(parameter, link.ask(_read(parameter, _first_counter(), items), patience))


def write(
    link: ParameterLink, parameter: Parameter, items: int, data: bytes, patience: Patience,
    agrees: Callable[[dict[str, Any]], bool],
) -> dict[str, Any]:  # fmt: skip
    """Read a parameter, write it, and read it back, as far as each of them is worth it; return what came of it all.

    ``agrees`` is given what is known before it is written, and says whether it is. What cannot be read, but for the
    access, is not written, and neither is what has another size.
    """
    first = _first_counter()
    outcomes = [link.ask(_read(parameter, first, items), patience)]
    if not may_be_written(outcomes[0]) or is_misfit(items, data, outcomes[0]):
        return write_document(parameter, items, data, outcomes)
    before = write_document(parameter, items, data, outcomes, cancelled=True)
    if not agrees(before):
        return before
    request = Message(
        Service.ODWriteRequest, parameter.index, parameter.subindex, first + 1 & 0xFFFF, items, data
    )  # fmt: skip
    outcomes.append(link.ask(request, patience))
    if outcomes[1].ending is Ending.REPLIED:
        outcomes.append(link.ask(_read(parameter, first + 2 & 0xFFFF, items), patience))
    return write_document(parameter, items, data, outcomes)


def _read(parameter: Parameter, counter: int, items: int) -> Message:
    return Message(Service.ODReadRequest, parameter.index, parameter.subindex, counter, items)


def _first_counter() -> int:
    """Return a Counter by which what came of an earlier run, to the same port, is told apart."""
    return int.from_bytes(os.urandom(2), "little")
