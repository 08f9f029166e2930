"""Conversation: which response answers which request of a connection, whatever happens to it.

A response answers the first request that waits. Where a direction loses step, nobody knows any more what waits.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from dissectors.http import Side
from dissectors.webvisu import Likeness
from nvscope.tracker.pieces import ORDER_BITS
from nvscope.tracker.visu.asking import NOTHING, Ask, fits
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.going_on import Closed
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.limits import MOST_WAITING
from nvscope.tracker.visu.messages import Kind
from nvscope.tracker.visu.one_way import UNKNOWN


class Waiting(NamedTuple):
    """A request that nobody has answered: what it asks for, its order, and when it had arrived.

    ``acknowledged`` is up to where its client had the server's bytes then, where none of these was captured; else -1.
    """

    asked: Ask
    order: int
    arrival_ns: int
    is_head: bool = False
    acknowledged: int = UNKNOWN


class Early(NamedTuple):
    """A response that came before the request was whole that it answers; its content, if it has any, is in its form."""

    form: Form
    arrival_ns: int


class Happened(NamedTuple):
    """Something to be told of a connection; ``message`` is the row of the HTTP message that it is about, or -1."""

    kind: Kind
    connection: int
    order: int
    message: int
    asked: Ask
    latency_ns: int
    asked_frame: int
    gap_bytes: int
    opens: bool


@dataclass(slots=True)
class Conversation:
    """One connection; ``is_visu`` from its first request of a WebVisu page on, ``gap_bytes`` are missing until then.

    ``beyond`` requests wait behind those that are ``waiting``: nobody remembers what they ask for. ``left_out`` are
    those of WebVisu pages of which that has not been told yet. ``closed`` is when the client closed its side: what
    waits then may still be answered. ``is_heard``: something that the server sent was captured, ``is_spoken``: the same
    of the client. ``early`` answers the request that the client has begun, before that is whole. ``acknowledged`` is up
    to where the server had the client's bytes, while none of them was captured, or -1.
    """

    connection: int
    waiting: deque[Waiting] = field(default_factory=deque)
    beyond: int = 0
    left_out: int = 0
    is_visu: bool = False
    gap_bytes: int = 0
    closed: Closed | None = None
    is_heard: bool = False
    is_spoken: bool = False
    acknowledged: int = UNKNOWN
    early: Early | None = None

    def take_from_client(
        self, form: Form, asked: Ask, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None]
    ) -> None:  # fmt: skip
        """Take what happens in the client's direction."""
        if form.what in (What.WHOLE, What.CUT):
            if self._is_of_page(form) or asked.request is not None:
                # What is whole and nobody reads is no better known than what is cut.
                kind = Kind.CUT if asked.request is None else Kind.READ
                self._tell_request(kind, asked, order, message, tell)
                self._tell_unbounded(form, order, tell)
            is_head = form.head is not None and form.head.method == "HEAD"
            self._wait(Waiting(NOTHING if form.what is What.CUT else asked, order, arrival_ns, is_head))
        elif form.what is What.PART:
            of_page = self._is_of_page(form)
            if of_page:
                self._tell_request(Kind.PART, asked, order, message, tell)
                self._tell_unbounded(form, order, tell)
            # Who breaks off its own request waits for nothing, but for what has come before.
            if form.broken_by is not Side.CLIENT or self.early is not None:
                self._wait(Waiting(asked if of_page else NOTHING, order, arrival_ns))
        elif form.what is What.BROKEN:
            if self._is_of_page(form):
                self._tell_request(Kind.CUT, NOTHING, order, message, tell)
            self.early = None
            self._forget_waiting()
        elif form.what is What.END:
            if form.broken_by is None:
                self.closed = Closed(order, arrival_ns)
                if self.is_heard:
                    self._tell_leaving(Kind.LEFT, order, tell)
        else:
            self._take_other(form, order, tell)
        self.is_spoken |= form.what is not What.END

    @property
    def waits(self) -> bool:
        """Whether a request waits for its reply."""
        return bool(self.waiting or self.beyond)

    def _is_of_page(self, form: Form) -> bool:
        """Tell whether what is not whole is a request of a page: what says nothing of itself, where others were."""
        return form.touched is Likeness.YES or (form.touched is Likeness.PERHAPS and self.is_visu)

    def _wait(self, one: Waiting) -> None:
        if self.beyond or len(self.waiting) >= MOST_WAITING:
            self.beyond += 1
            self.left_out += one.asked.request is not None
        else:
            self.waiting.append(one)

    def _forget_waiting(self) -> None:
        self.waiting.clear()
        self.beyond = 0

    def _tell_request(
        self, kind: Kind, asked: Ask, order: int, message: int, tell: Callable[[Happened], None]
    ) -> None:  # fmt: skip
        tell(Happened(kind, self.connection, order, message, asked, 0, 0, self.gap_bytes, not self.is_visu))
        self.is_visu, self.gap_bytes = True, 0

    def take_from_server(
        self, form: Form, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None]
    ) -> None:  # fmt: skip
        """Take what happens in the server's direction."""
        if form.what is What.ANEW:
            self._take_other(form, order, tell)
        was_heard, self.is_heard = self.is_heard, self.is_heard or form.what is not What.END
        self._take_from_server(form, order, arrival_ns, message, tell)
        if not was_heard and self.is_heard and self.closed is not None:
            self.closed = self.closed._replace(order=order)
            self._tell_leaving(Kind.LEFT, order, tell)

    def _take_from_server(
        self, form: Form, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None]
    ) -> None:  # fmt: skip
        if form.what in (What.WHOLE, What.CUT):
            is_interim = form.head is not None and form.head.is_interim
            if is_interim or form.answers_nobody:
                return
            is_cut = form.what is What.CUT
            if form.is_late and not is_cut and self.waiting and not fits(self.waiting[0].asked, form):
                self._doubt(order, tell)
            if self.waiting:
                asked = self.waiting.popleft()
                if is_cut:
                    self._tell_answer(Kind.CUT, asked, order, arrival_ns, message, tell)
                elif asked.asked.is_part:
                    # What says that a part was done says nothing of it.
                    is_refused = form.head is not None and form.head.status != OK
                    kind = Kind.REFUSED if is_refused else Kind.UNCLEAR
                    self._tell_answer(kind, asked, order, arrival_ns, message, tell)
                elif asked.asked.request is not None or not form.is_unread:
                    self._tell_answer(Kind.REPLY, asked, order, arrival_ns, message, tell)
                if asked.asked.request is not None:
                    self._tell_unbounded(form, order, tell)
            elif self.beyond:
                self.beyond -= 1
        elif form.what is What.BROKEN:
            if self.waiting and form.touched is Likeness.YES:
                self._tell_answer(Kind.CUT, self.waiting[0], order, arrival_ns, message, tell)
            else:
                self._tell_leaving(Kind.UNCLEAR, order, tell)
            self._forget_waiting()
        elif form.what is What.END:
            self._tell_unanswered(order, arrival_ns, tell, by_client=form.broken_by is Side.CLIENT)
        elif form.what is not What.ANEW:
            self._take_other(form, order, tell)

    def _doubt(self, order: int, tell: Callable[[Happened], None]) -> None:
        """Take that a response may answer a request from before the capture: so may those that follow."""
        for place, one in enumerate(self.waiting):
            if one.asked.request is not None:
                self._tell_answer(Kind.UNCLEAR, one, order, 0, -1, tell)
                self.waiting[place] = one._replace(asked=NOTHING)

    def answer_early(self, order: int, message: int, tell: Callable[[Happened], None]) -> None:
        """Take that the request is whole, with an order, that was answered before; the response is a message now."""
        assert self.early is not None
        form, arrival_ns = self.early
        self.early = None
        if self.waiting:
            self.take_from_server(form, order, max(arrival_ns, self.waiting[0].arrival_ns), message, tell)

    def note_acknowledged(self, acknowledged: int) -> None:
        """Note up to where the client has the server's bytes, none of which was captured, with its last request."""
        self.waiting[-1] = self.waiting[-1]._replace(acknowledged=acknowledged)

    def miss_reply(self, order: int, size: int, tell: Callable[[Happened], None]) -> None:
        """Take that the server has sent bytes that were not captured: the reply to the first request is among them."""
        self._miss(order, size, tell)
        self._tell_answer(Kind.CUT, self.waiting[0], order, 0, -1, tell)
        self._forget_waiting()

    def miss_request(self, order: int, size: int, tell: Callable[[Happened], None]) -> None:
        """Take that the client has sent bytes that were not captured, a request of a page among them."""
        self._miss(order, size, tell)
        self._tell_request(Kind.CUT, NOTHING, order, -1, tell)

    def _miss(self, order: int, size: int, tell: Callable[[Happened], None]) -> None:
        self._take_other(Form(What.GAP, missing_bytes=size), order, tell)

    def _tell_unbounded(self, form: Form, order: int, tell: Callable[[Happened], None]) -> None:
        if form.head is not None and form.head.is_unbounded:
            tell(Happened(Kind.UNBOUNDED, self.connection, order, -1, NOTHING, 0, 0, 0, False))

    def _tell_leaving(self, kind: Kind, order: int, tell: Callable[[Happened], None]) -> None:
        """Tell what waits while its client is leaving: it has closed its side."""
        if self.closed is not None:
            for asked in self.waiting:
                self._tell_answer(kind, asked, order, self.closed.arrival_ns, -1, tell)

    def give_up(self, order: int, tell: Callable[[Happened], None]) -> None:
        """Take that the client, which has closed its side, waits for nothing any more."""
        assert self.closed is not None
        self._tell_unanswered(order, self.closed.arrival_ns, tell, by_client=True)

    def _tell_unanswered(
        self, order: int, ended_ns: int, tell: Callable[[Happened], None], *, by_client: bool
    ) -> None:  # fmt: skip
        for asked in self.waiting:
            # Who closes its side with the request waits for the reply: it is the other one that ends the connection.
            closed_ns = asked.arrival_ns if self.closed is None else self.closed.arrival_ns
            is_left = by_client or closed_ns > asked.arrival_ns
            until_ns = closed_ns if closed_ns > asked.arrival_ns else ended_ns
            kind = Kind.GIVEN_UP if is_left else Kind.UNANSWERED
            self._tell_answer(kind, asked, order, until_ns, -1, tell)
        self._forget_waiting()

    def _tell_answer(
        self, kind: Kind, asked: Waiting, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None]
    ) -> None:  # fmt: skip
        if asked.asked.request is None:
            if not asked.asked.is_list or kind is not Kind.REPLY:
                return
            kind = Kind.NAMES
        if kind is Kind.CUT:
            tell(Happened(kind, self.connection, order, message, NOTHING, 0, 0, 0, False))
            return
        latency_ns = arrival_ns - asked.arrival_ns if kind in (Kind.REPLY, Kind.GIVEN_UP, Kind.LEFT) else 0
        frame = asked.order >> ORDER_BITS
        tell(Happened(kind, self.connection, order, message, asked.asked, latency_ns, frame, 0, False))

    def _take_other(self, form: Form, order: int, tell: Callable[[Happened], None]) -> None:
        if form.what is What.ANEW:
            self._forget_waiting()
            self.is_visu, self.gap_bytes, self.closed, self.early = False, 0, None, None
            self.is_heard, self.is_spoken, self.acknowledged = False, False, UNKNOWN
        elif form.what is What.GAP:
            if self.is_visu:
                tell(Happened(Kind.GAP, self.connection, order, -1, NOTHING, 0, 0, form.missing_bytes, False))
            else:
                self.gap_bytes += form.missing_bytes
