"""Head requests: which responses have no body whatever they say, since they answer HEAD (RFC 9110, section 9.3.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from dissectors.batch import I64
from nvscope.tracker.visu.http_forms import Form, What


class HeadRequests:
    """The requests of a connection that wait while a batch of what its server sends is read.

    ``waiting`` says of each that waits before it whether it is HEAD. ``asked`` is what the client's direction shows in
    the batch: orders (``nvscope.tracker.pieces``), and what it is. ``ends`` are where pieces end in the data that is
    read, ``orders`` those of pieces.
    """

    def __init__(
        self, waiting: Iterable[bool], asked: Iterable[tuple[int, Form]], ends: I64, orders: I64
    ) -> None:  # fmt: skip
        self._waiting = deque(waiting)
        self._asked = deque(asked)
        self._ends, self._orders = ends, orders

    def answers_head(self, at: int) -> bool:
        """Tell whether the response whose head ends at a place of the data answers HEAD."""
        self._go_on(at)
        return bool(self._waiting) and self._waiting[0]

    def answered(self, at: int) -> None:
        """Take the end of a response."""
        self._go_on(at)
        if self._waiting:
            self._waiting.popleft()

    def forget(self, at: int) -> None:
        """Take that the server's direction loses step."""
        self._go_on(at)
        self._waiting.clear()

    def _go_on(self, at: int) -> None:
        order = int(self._orders[~at if at < 0 else int(self._ends.searchsorted(at))])
        while self._asked and self._asked[0][0] < order:
            _, form = self._asked.popleft()
            if form.what in (What.WHOLE, What.CUT):
                self._waiting.append(form.head is not None and form.head.method == "HEAD")
            elif form.what in (What.BROKEN, What.ANEW):
                self._waiting.clear()
