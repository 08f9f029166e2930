"""What the log of a tracker tells of: the kinds of events, named by what happened.

Whether something is a finding, and of which code, is for ``nvscope.findings`` to say; nothing here knows codes.
"""

from __future__ import annotations

from enum import IntEnum

FRAMES_KEPT = 10
"""Of the events of one kind and place, so many frames are kept: those of the first ones."""


class EventKind(IntEnum):
    """What happened to a telegram or frame.

    The numbers order the log and stand nowhere else: neither files nor reports have them.
    """

    SHORT = 1
    LENGTH_MISMATCH = 2
    UNKNOWN_SERVICE = 3
    RESERVED_FLAGS = 4
    LENGTH_BYTE_SWAPPED = 5
    ASCII_IDENTITY = 6
    TRUNCATED = 7
    NO_ACKNOWLEDGEMENT = 8
    NEGATIVE_ACKNOWLEDGEMENT = 9
    UNEXPECTED_ACKNOWLEDGEMENT = 10
    BOOT_UP_UNANSWERED = 11
    SEND_REJECTED = 12
    SHAPE_CHANGED = 13
    CHECKSUM_CHANGED = 14
    FLAGS_INCONSISTENT = 15
    PDO_LENGTH_CHANGED = 16
    GAP = 17
    OVERTAKEN = 18
    RESTART = 19
    DUPLICATE = 20
    STEP_BACK = 21
    UNREADABLE_FRAME = 22
    ERROR_FRAME = 23


TELL_IN_NUMBERS = (
    EventKind.GAP, EventKind.OVERTAKEN, EventKind.RESTART, EventKind.DUPLICATE, EventKind.STEP_BACK,
    EventKind.UNREADABLE_FRAME, EventKind.ERROR_FRAME,
)  # fmt: skip
"""Those of which one alone says little: whether they are a finding depends on what a Counter counts, or how many."""
