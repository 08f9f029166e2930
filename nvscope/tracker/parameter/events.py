"""What happens between who asks for a parameter and who is asked, as events.

``node`` is who asks, ``peer`` who is asked, ``pair`` their number with the port (``Transactions.pairs``), ``detail``
Index and SubIndex of the parameter (``parameter_of``).
"""

from __future__ import annotations

from enum import IntEnum

from nvscope import units


class ParameterEvent(IntEnum):
    """What is told of transactions, in frames of replies but for timeouts, which are told of the first request.

    ``WRITE_ASKED`` is a request to write, told of its first frame. ``since_ns`` is when the request came first. The
    amount is the service of the reply; of what has none, that of the request. No other enumeration of events has the
    same numbers: who listens for kinds compares numbers.
    """

    REPLIED = 1001
    ERROR_REPLY = 1002
    BUSY = 1003
    TIMEOUT = 1004
    UNEXPECTED_REPLY = 1005
    SLOW = 1006
    WRITE_ASKED = 1007


def parameter_name(detail: int) -> str:
    """Return what a parameter is called where nobody has named it, from Index and SubIndex as one."""
    return units.parameter(detail >> 16, detail & 0xFFFF)


USUAL = (ParameterEvent.REPLIED, ParameterEvent.BUSY, ParameterEvent.WRITE_ASKED)
"""The events with which nothing is wrong."""
