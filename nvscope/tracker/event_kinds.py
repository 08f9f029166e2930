"""What the tracker tells of: the kinds of events, named by what happened.

Whether something is a finding, and of which code, is for ``nvscope.findings`` to say; nothing here knows codes.
"""

from __future__ import annotations

from enum import IntEnum

FRAMES_KEPT = 10
"""Of the events of one kind and place, so many frames are kept: those of the first ones."""


class EventKind(IntEnum):
    """What happened to a telegram or frame, and what the columns of ``EventBatch`` tell of it beside time and place.

    ``since``, ``amount``, ``peer`` and ``detail`` say what stands in the columns of these names, "" where there is
    nothing. The numbers order the log and stand nowhere else: neither files nor reports have them.
    """

    since: str
    amount: str
    peer: str
    detail: str

    def __new__(cls, number: int, since: str = "", amount: str = "", peer: str = "", detail: str = "") -> EventKind:
        kind = int.__new__(cls, number)
        kind._value_ = number
        kind.since, kind.amount, kind.peer, kind.detail = since, amount, peer, detail
        return kind

    SHORT = 1
    LENGTH_MISMATCH = 2
    UNKNOWN_SERVICE = 3
    RESERVED_FLAGS = 4
    LENGTH_BYTE_SWAPPED = 5
    ASCII_IDENTITY = 6
    TRUNCATED = 7

    NO_ACKNOWLEDGEMENT = (8, "when the telegram was sent", "", "to whom it was sent", "")
    NEGATIVE_ACKNOWLEDGEMENT = (9, "", "", "who rejects it", "")
    UNEXPECTED_ACKNOWLEDGEMENT = (10, "", "", "to whom it was sent", "")
    BOOT_UP_UNANSWERED = (11, "when it was asked", "", "who asked", "")
    SEND_REJECTED = (12, "", "the ICMP code", "to whom the telegram was sent", "number of the node that says so")
    ACKNOWLEDGED = (13, "when the telegram was sent", "", "who acknowledged it, or rejects it", "")

    SHAPE_CHANGED = (14, "", "", "", "Length << 16 | Items")
    CHECKSUM_CHANGED = (15, "", "", "", "Checksum")
    FLAGS_INCONSISTENT = (16, "", "", "", "Flags")
    PDO_LENGTH_CHANGED = (17, "", "", "", "Length << 16 | Items")

    GAP = (18, "the telegram before", "how many were left out", "", "")
    OVERTAKEN = (19, "the telegram before", "how many lost ones it takes back", "", "how far its Counter is behind")
    RESTART = (20, "the telegram before", "", "", "")
    DUPLICATE = (21, "the telegram before", "", "", "")

    UNUSUAL_INTERVAL = (22, "its beginning", "how long it was, in ns", "", "nvscope.tracker.timing: bits of loss in it")
    TORN_CYCLE = (23, "its first telegram", "how many telegrams it has", "", "bits of the SubIndexes that it lacks")

    STEP_BACK = (24, "the frame before", "how far back, in ns", "", "")

    UNREADABLE_FRAME = (25, "", "", "", "dissectors.can.frame.Fault")
    ERROR_FRAME = (26, "", "", "", "dissectors.can.error: classes")
    BUS_OFF = 27
    BUS_BACK = (28, "when it left the bus", "", "", "1 where a frame says so, 0 where it sends again")
    NODE_STATE = (29, "", "the state of a CANopen node, 0 at boot-up", "", "the node")
    EMERGENCY = (30, "", "the error code", "", "the node")
    NODE_COMMAND = (31, "", "the NMT command", "", "the node, 0 for all")

    BOOT_UP_ANSWERED = (32, "when it was asked", "", "who asked", "")


TELL_IN_NUMBERS = (
    EventKind.ACKNOWLEDGED, EventKind.BOOT_UP_ANSWERED, EventKind.GAP, EventKind.OVERTAKEN, EventKind.RESTART,
    EventKind.DUPLICATE, EventKind.UNUSUAL_INTERVAL, EventKind.TORN_CYCLE, EventKind.STEP_BACK,
    EventKind.UNREADABLE_FRAME, EventKind.ERROR_FRAME, EventKind.BUS_OFF, EventKind.BUS_BACK, EventKind.NODE_STATE,
    EventKind.EMERGENCY, EventKind.NODE_COMMAND,
)  # fmt: skip
"""Those of which one alone says little, or nothing bad: whether they are a finding takes more than the event."""
