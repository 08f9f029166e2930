"""What a sender's Counter counts: the scopes it may have."""

from __future__ import annotations

from enum import IntEnum


class Scope(IntEnum):
    """What a sender's Counter counts; of equal evidence, the earlier one."""

    STREAM = 0
    NODE_TELEGRAM = 1
    NODE_SEND = 2


SCOPE_NAMES = {Scope.STREAM: "stream", Scope.NODE_TELEGRAM: "node-telegram", Scope.NODE_SEND: "node-send"}
SCOPE_UNUSED = "unused"
