"""What happens between who asks for a parameter and who is asked, as events.

``node`` is who asks, ``peer`` who is asked, ``pair`` their number with the port (``Transactions.pairs``), ``detail``
Index and SubIndex of the parameter (``parameter_of``).
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U64
from dissectors.netvar import PORT
from nvscope import units

_KIND_BITS = 16


class ParameterEvent(IntEnum):
    """What is told of transactions, in frames of replies but for timeouts, which are told of the first request.

    ``WRITE_ASKED`` is a request to write, told of its first frame; ``WRITE_UNSEEN`` is a reply to one that was not
    captured, which is told as unexpected, too. ``since_ns`` is when the request came first; of a reply that ends none,
    too, if that was given up before, else when the reply came. The amount is the service
    of the reply; of what has none, that of the request. No other enumeration of events has the same numbers: who
    listens for kinds compares numbers.
    """

    REPLIED = 1001
    ERROR_REPLY = 1002
    BUSY = 1003
    TIMEOUT = 1004
    UNEXPECTED_REPLY = 1005
    SLOW = 1006
    WRITE_ASKED = 1007
    WRITE_UNSEEN = 1008


def parameter_name(detail: int) -> str:
    """Return what a parameter is called where nobody has named it, from Index and SubIndex as one."""
    return units.parameter(detail >> 16, detail & 0xFFFF)


def partner_name(partner: str, port: int) -> str:
    """Return what a partner is called, by its address: with the port where that is not the usual one."""
    return partner if port == PORT else units.endpoint(partner, port)


def variable_name(partner: str, port: int, name: str) -> str:
    """Return what findings call a parameter: ``sdo/192.168.1.20/0x2000:1``, or ``sdo/192.168.1.20:1300/0x2000:1``."""
    return f"sdo/{partner_name(partner, port)}/{name}"


class Place(NamedTuple):
    """Who is asked, on which port, for which parameter: the parts of ``variable_name``."""

    partner: str
    port: int
    parameter: str


def place_of(variable: str) -> Place:
    """Return what ``variable_name`` was made of."""
    _, partner, parameter = variable.split("/", 2)
    address, _, port = partner.rpartition(":")
    if not address or (":" in address and not address.startswith("[")):
        return Place(partner, PORT, parameter)
    return Place(address.removeprefix("[").removesuffix("]"), int(port), parameter)


USUAL = (
    ParameterEvent.REPLIED, ParameterEvent.BUSY, ParameterEvent.WRITE_ASKED, ParameterEvent.WRITE_UNSEEN
)  # fmt: skip
"""The events that are no finding."""


def event_word(event: ParameterEvent, apart: I64) -> U64:
    """Return by what events are told apart: their kind, of error replies which one, of unexpected ones if too late."""
    told_apart = ParameterEvent.ERROR_REPLY, ParameterEvent.UNEXPECTED_REPLY
    own = apart if event in told_apart else np.zeros(len(apart), np.int64)
    return (own << _KIND_BITS | int(event)).view(np.uint64)


def event_parts(word: int) -> tuple[int, int]:
    """Return the kind of events, and what tells some of them apart, from ``event_word``."""
    return word & ((1 << _KIND_BITS) - 1), word >> _KIND_BITS
