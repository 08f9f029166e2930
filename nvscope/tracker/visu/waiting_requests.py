"""Waiting requests: what a response answers, as far as that says where messages end.

A response has no body, whatever it says, where it answers HEAD (RFC 9110, section 9.3.2). And a request that does not
say how long it is ends at the latest where it is answered; one that says so may be answered early, before it is whole.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

from dissectors.batch import I64
from nvscope.tracker.pieces import NEVER
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.limits import MOST_WAITING


class Waiting(NamedTuple):
    """The requests of a connection that wait: whether each is HEAD, and how many there are ``beyond`` these.

    ``is_early``: the one that has begun, and is not whole, is answered. ``first`` is the order of the first of them,
    and up to where its client had the server's bytes then, where none of these was captured.
    """

    are_head: Iterable[bool] = ()
    beyond: int = 0
    is_early: bool = False
    first: tuple[int, int] | None = None


class Missed(Protocol):
    """Tells of a connection since when it is known that replies of a server were missed of which nothing was heard."""

    def acknowledged(self, order: int) -> int:
        """Return up to where the client acknowledges the server's bytes with an order."""
        ...

    def by(self, order: int, acknowledged: int) -> int:
        """Return with which order a reply was missed to what was asked with one; ``NEVER`` without any."""
        ...


class Asked(NamedTuple):
    """What the client's direction shows with an order; and with which one the head was there, if it is a request."""

    order: int
    form: Form
    head_order: int = NEVER


class Unheard:
    """What a client's direction shows until its server is heard, and where replies to it were missed.

    ``first`` is as in ``Waiting``. Nobody knows any more what waits then (``Conversation.miss_reply``).
    """

    def __init__(self, first: tuple[int, int] | None, missed: Missed) -> None:
        self._missed, self._waits = missed, first is not None
        self._order = NEVER if first is None else missed.by(*first)

    def take(self, asked: Iterable[Asked]) -> list[Asked]:
        """Return more of what the client's direction shows, with where nobody knows any more what waits."""
        found: list[Asked] = []
        for one in asked:
            if self._order < one.order:
                found += self.rest()
            if one.form.what in (What.BROKEN, What.ANEW):
                self._order, self._waits = NEVER, False
            elif one.form.what in (What.WHOLE, What.CUT, What.PART) and not self._waits:
                self._waits = True
                self._order = self._missed.by(one.order, self._missed.acknowledged(one.order))
            found.append(one)
        return found

    def rest(self) -> list[Asked]:
        """Return what is missed behind all that the client's direction showed."""
        order, self._order, self._waits = self._order, NEVER, False
        return [] if order == NEVER else [Asked(order, Form(What.BROKEN))]


class WaitingRequests:
    """The requests of a connection that wait while a batch of what its server sends is read.

    ``waiting`` are those before it. ``asked`` is what the client's direction shows in the batch (orders are those of
    ``nvscope.tracker.pieces``), ``begun`` with which order the head was there of what is not whole behind that.
    ``ends`` are where pieces end in the data that is read, ``orders`` those of pieces. ``answers_more`` is called with
    a place of the data where something comes that answers a request, and none waits; it tells whether that is one that
    has begun. ``begins_head`` tells by such a place whether what has begun is HEAD.
    """

    def __init__(
        self, waiting: Waiting, asked: Iterable[Asked], ends: I64, orders: I64,
        answers_more: Callable[[int], bool] | None = None, begun: int = NEVER,
        begins_head: Callable[[int], bool] = lambda _: False,
    ) -> None:  # fmt: skip
        self._waiting, self._beyond, self._is_early = deque(waiting.are_head), waiting.beyond, waiting.is_early
        self._begun = begun
        self._asked = deque(asked)
        self._ends, self._orders = ends, orders
        self._answers_more, self._begins_head = answers_more, begins_head

    def ask(self, asked: Iterable[Asked]) -> None:
        """Take more of what the client's direction shows."""
        self._asked.extend(asked)

    def answers_head(self, at: int) -> bool:
        """Tell whether the response whose head ends at a place of the data answers HEAD, which waits or has begun."""
        order = self._go_on(at)
        if self._waiting:
            return self._waiting[0]
        if self._beyond or self._is_early:
            return False
        asked = self._first_asked()
        if asked is not None:
            return asked.head_order < order and _is_head(asked.form)
        return (self._answers_more is not None or self._begun < order) and self._begins_head(at)

    def _first_asked(self) -> Asked | None:
        """Return what the client's direction shows next."""
        return next((one for one in self._asked if one.form.what is not What.GAP), None)

    def answered(self, at: int) -> None:
        """Take the end of a response, or that there was one of which bytes are missing."""
        order = self._go_on(at)
        if self._waiting:
            self._waiting.popleft()
        elif self._beyond:
            self._beyond -= 1
        else:
            asked = self._first_asked()
            if asked is None and self._answers_more is not None:
                self._is_early |= self._answers_more(at)
            else:
                self._is_early |= (self._begun if asked is None else asked.head_order) < order

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

    def _go_on(self, at: int) -> int:
        """Take what the client shows in front of a place of the data; return the order of that."""
        order = int(self._orders[~at if at < 0 else int(self._ends.searchsorted(at))])
        while self._asked and self._asked[0].order < order:
            form = self._asked.popleft().form
            if form.what in (What.WHOLE, What.CUT, What.PART):
                if self._is_early:
                    self._is_early = False
                elif self._beyond or len(self._waiting) >= MOST_WAITING:
                    self._beyond += 1
                else:
                    self._waiting.append(_is_head(form))
            elif form.what in (What.BROKEN, What.ANEW):
                self._is_early = False
                self._forget()
        return order


def _is_head(form: Form) -> bool:
    return form.head is not None and form.head.method == "HEAD"
