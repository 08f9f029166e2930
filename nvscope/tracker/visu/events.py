"""What happens between web visualization pages and controllers, as events."""

from __future__ import annotations

from enum import IntEnum


class VisuEvent(IntEnum):
    """What is told of requests and replies, in the frame with which that is known.

    What nobody answered is told of the frame of the request, and of the time at which that was sure. Of ``WRITTEN``,
    ``REFUSED`` and ``PASSWORD_SEEN`` there is one for each variable. ``LATE`` is whatever is slow, unanswered or given
    up: ``GIVEN_UP`` is what is unanswered since the client waits no more, ``RESET`` since the server broke the
    connection off. ``PART_STATUS`` is the ``STATUS`` of a request that was never sent whole, and is not known to write.
    ``OTHER_NAMES``: a list of variables contradicts those known before, ``UNREAD_LIST``: nobody can read one,
    ``OTHER_ENCODING``: nobody can read texts as a page says that they are. ``CUT``:
    bytes of a request or a reply are missing. ``AMBIGUOUS``: texts have separators in them, and nobody knows what
    belongs to which. ``UNBOUNDED``: nobody knows where a request or reply ends.
    """

    WRITTEN = 1
    REFUSED = 2
    STATUS = 3
    PASSWORD_SEEN = 4
    MISCOUNTED = 5
    SLOW = 6
    UNANSWERED = 7
    LATE = 8
    OTHER_NAMES = 9
    GIVEN_UP = 10
    CUT = 11
    AMBIGUOUS = 12
    UNREAD_LIST = 13
    RESET = 14
    PART_STATUS = 15
    UNBOUNDED = 16
    OTHER_ENCODING = 17


OK = 200
"""The HTTP status of what was not refused."""

OTHER_STATUS = (1 << 16) - 1
"""Stands for HTTP statuses of which there were too many to keep them apart."""

_EVENT_BITS = 16


def event_word(event: VisuEvent, status: int = 0) -> int:
    """Return by what events are told apart: their kind, and for what was refused the HTTP status of the reply."""
    return status << _EVENT_BITS | int(event)


def event_parts(word: int) -> tuple[VisuEvent, int]:
    """Return kind and HTTP status, 0 without one, from ``event_word``."""
    return VisuEvent(word & ((1 << _EVENT_BITS) - 1)), word >> _EVENT_BITS
