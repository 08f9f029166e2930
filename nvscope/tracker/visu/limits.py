"""Limits: how much of what web visualization pages say there is room for, and what is told where a limit bites."""

from __future__ import annotations

from enum import IntEnum

MOST_PAIRS = 1 << 17
"""Between so many clients and servers, by port, messages are followed."""

MOST_EARLY = 4
"""So many responses of a connection are kept that were captured before what they may answer."""

MOST_WAITING = 256
"""So many requests of a connection are waited for at a time."""

MOST_HELD_BYTES = 1 << 26
"""Messages that are not whole are held up to so many bytes, of all connections."""

MOST_POLLED = 1 << 16
"""Of so many reads that differ it is known when they were asked for last."""

MOST_NAMES = 1 << 20
"""So many names of variables are kept, those of earlier lists among them."""

MOST_ENTRIES = 1 << 18
"""Variables of so many requests are remembered, one in several requests as often."""


class Beyond(IntEnum):
    """That for which there is no room.

    Pairs of client and server, variables that differ, findings on more of these, writes, connections at a time,
    requests that wait, messages that are not whole, names, reads whose interval is measured, minutes of writes, and
    messages that are too long to be read, or coded in a way that nobody knows.
    """

    PAIR = 0
    VARIABLE = 1
    FINDING = 2
    WRITE = 3
    CONNECTION = 4
    WAITING = 5
    HELD = 6
    NAMES = 7
    POLLED = 8
    WRITE_MINUTE = 9
    UNREAD = 10
