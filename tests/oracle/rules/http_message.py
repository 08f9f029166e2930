"""What is found in one direction of a connection: messages of HTTP, and where step was lost."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Message:
    """A request or a response, or what was seen of one.

    ``body`` is decoded; None where it is not known: cut, longer than its limit, or not to be decoded. ``seen`` is what
    came of it before the first missing byte, as it came. ``whole`` tells whether it came to its end, cut or not;
    ``broken_off``: that its end is the reset of the connection, and nobody knows whether more should have come;
    ``part``: that no more than a part of it was sent; ``unasked``: that it is a response to
    HEAD, which was not captured; ``late``: that it may be one to a request from before the capture;
    ``unbounded``: that nobody knows where it ends, and ``malformed``: that this is so since its chunks are none;
    ``unread``: that nothing is missing of it, and nobody reads it; ``early``: that it came before its request.
    ``begin_at`` is the sequence number of the first byte of a whole message that says how long it is,
    ``head_at`` and ``behind`` are the sequence numbers behind its head,
    and behind all of it, or both the latter where not all of it came; ``told`` is what the segment with which it was
    whole acknowledges. Of what ends otherwise than by what it says, nobody knows them.
    """

    method: bytes = b""
    target: bytes = b""
    status: int = 0
    body: bytes | None = None
    seen: bytes = b""
    cut: bool = False
    whole: bool = True
    arrival: int = 0
    broken_off: bool = False
    part: bool = False
    unasked: bool = False
    late: bool = False
    unbounded: bool = False
    unread: bool = False
    malformed: bool = False
    early: bool = False
    begin_at: int | None = None
    head_at: int | None = None
    behind: int | None = None
    told: int | None = None
    has: int | None = None
    """What it acknowledges where it answers a request that has begun, whatever it ``told``."""
    missing_to: int | None = None
    """Up to where bytes are missing, where nothing but these is known of it."""


@dataclass
class Lost:
    """The direction has lost step; ``dropped`` is the message that a hole touched, if it was ``in_step`` before.

    Or it is the one whose head is too long.
    """

    dropped: Message | None = None
    in_step: bool = False
    missing: bool = False
    told: int | None = None
    size: int = 0
    """How many bytes are missing, in front of the sequence number ``behind``."""
    behind: int = 0

    def response(self) -> Message:
        """Return the response that is lost; behind 1xx, that is in what is missing, too."""
        message = self.dropped
        if message is None or 100 <= message.status < 200:
            message = Message(cut=True, whole=False)
        message.missing_to = self.behind if self.missing else None
        return message
