"""Waiting requests: what a response answers, as far as that says where messages end.

A response has no body, whatever it says, where it answers HEAD (RFC 9110, section 9.3.2). And a request that does not
say how long it is ends at the latest where it is answered.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

from dissectors.batch import I64
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.limits import MOST_WAITING


class Waiting(NamedTuple):
    """The requests of a connection that wait: whether each is HEAD, and how many there are ``beyond`` these."""

    are_head: Iterable[bool] = ()
    beyond: int = 0


class WaitingRequests:
    """The requests of a connection that wait while a batch of what its server sends is read.

    ``waiting`` are those before it. ``asked`` is what the client's direction shows in the batch: orders
    (``nvscope.tracker.pieces``), and what it is. ``ends`` are where pieces end in the data that is read, ``orders``
    those of pieces. ``answers_more`` is called with a place of the data where something comes that answers a request,
    and none waits.
    """

    def __init__(
        self, waiting: Waiting, asked: Iterable[tuple[int, Form]], ends: I64, orders: I64,
        answers_more: Callable[[int], None] | None = None,
    ) -> None:  # fmt: skip
        self._waiting, self._beyond = deque(waiting.are_head), waiting.beyond
        self._asked = deque(asked)
        self._ends, self._orders = ends, orders
        self._answers_more = answers_more

    def ask(self, asked: Iterable[tuple[int, Form]]) -> None:
        """Take more of what the client's direction shows."""
        self._asked.extend(asked)

    def answers_head(self, at: int) -> bool:
        """Tell whether the response whose head ends at a place of the data answers HEAD."""
        self._go_on(at)
        return bool(self._waiting) and self._waiting[0]

    def answered(self, at: int) -> None:
        """Take the end of a response, or that there was one of which bytes are missing."""
        self._go_on(at)
        if self._waiting:
            self._waiting.popleft()
        elif self._beyond:
            self._beyond -= 1
        elif self._answers_more is not None:
            self._answers_more(at)

    def ended(self, at: int) -> None:
        """Take that the server has closed its side: what has not been answered never is."""
        self._go_on(at)
        if not (self._waiting or self._beyond) and self._answers_more is not None:
            self._answers_more(at)

    def forget(self, at: int) -> None:
        """Take that the server's direction loses step."""
        self._go_on(at)
        self._forget()

    def _forget(self) -> None:
        self._waiting.clear()
        self._beyond = 0

    def _go_on(self, at: int) -> None:
        order = int(self._orders[~at if at < 0 else int(self._ends.searchsorted(at))])
        while self._asked and self._asked[0][0] < order:
            _, form = self._asked.popleft()
            if form.what in (What.WHOLE, What.CUT):
                if self._beyond or len(self._waiting) >= MOST_WAITING:
                    self._beyond += 1
                else:
                    self._waiting.append(form.head is not None and form.head.method == "HEAD")
            elif form.what in (What.BROKEN, What.ANEW):
                self._forget()
