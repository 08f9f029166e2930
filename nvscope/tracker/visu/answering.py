"""Answering: what is known of the requests that the messages of a direction answer, while that is read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.http import Body, Head, Side
from dissectors.webvisu import Likeness
from nvscope.tracker.visu.part_requests import behind_body, bodied_at

if TYPE_CHECKING:
    from nvscope.tracker.visu.waiting_requests import WaitingRequests


class Answering:
    """The part of ``HttpReader`` that says what is answered.

    ``is_late``: a server's stream began in the middle, and no response with a body has come yet: what comes may answer
    a request that was not captured. ``is_wary``: that is so, or one of both directions has lost step since; what comes
    may answer HEAD, which nobody saw. ``may_answer_head``: that was ever so. Several requests may be missing, and of
    one response with a body it is not known that it is the last one to these: a status line in the place of a body
    tells it. ``known_at`` is up to where one had to read to know what is read now, or 0.
    """

    __slots__ = (
        "_answers_head", "_answers_nobody", "is_late", "is_wary", "known_at", "may_answer_head", "requests", "side",
    )  # fmt: skip

    def __init__(self, side: Side) -> None:
        self.side = side
        self.requests: WaitingRequests | None = None
        # Of the response that has begun, None before its head is there.
        self._answers_head: bool | None = None
        self._answers_nobody = False
        self.known_at, self.is_late, self.is_wary, self.may_answer_head = 0, False, False, False

    def _is_to_head(self, at: int) -> bool:
        """Tell whether the response whose head ends at a place answers HEAD: what waited then says so, not later."""
        if self._answers_nobody:
            return False
        if self._answers_head is None:
            self._answers_head = self.requests is not None and self.requests.answers_head(max(at, self.known_at))
        return self._answers_head

    def _answered(self, at: int, head: Head | None, begin: int | None = None) -> bool:
        """Take the end of a message; return whether it answers nobody. ``begin`` is where it begins, if not there."""
        nobody = self._answers_nobody
        self._answers_head, self._answers_nobody = None, False
        is_unasked = nobody and head is None
        if self.requests is not None and not is_unasked and not (head is not None and head.is_interim):
            known_at = at if at < 0 else max(at, self.known_at)
            self.requests.answered(known_at, at if begin is None else begin, at, to_nobody=nobody)
        if self.is_wary and head is not None and head.has_body:
            self.is_late = self.is_wary = False
        return nobody

    def _line_in_place_of_body(self, data: bytes, head_end: int, end: int, head: Head) -> int:
        """Return as ``behind_body`` does; below 0 where more has to come to go on. Note up to where one had to read."""
        line = behind_body(data, head_end, end, head, self.side)
        if self.side is Side.CLIENT and head.body is not Body.LENGTH:
            return max(line, 0)
        if not line:
            self.known_at = max(self.known_at, bodied_at(data, head_end, head, self.side))
        return line

    def _may_lack_body(self, rest: bytes, head_end: int, head: Head) -> bool:
        """Tell whether nothing that is there behind a head shows that a message has a body."""
        if not self.is_wary or self.is_late:
            return False
        return behind_body(rest, head_end, len(rest), head, self.side) != 0

    def _if_answers(self) -> Likeness:
        """Tell whether what has begun is a response to the first request that waits."""
        return Likeness.NO if self._answers_nobody else Likeness.YES

    def _may_be_known(self, head: Head) -> bool:
        """Tell whether all messages with such a head are read alike."""
        return self.requests is None and head.method != "HEAD" and not (head.is_interim or head.expects)
