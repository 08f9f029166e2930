"""Conversation: which response answers which request of a connection, whatever happens to it.

A response answers the first request that waits, if its server had that when it answered (``reach``). Where a direction
loses step, nobody knows any more what waits, and, where bytes are missing, what answers the next request (``turns``).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.http import Side
from dissectors.webvisu import Likeness
from nvscope.tracker.pieces import ORDER_BITS
from nvscope.tracker.visu.asking import NOTHING, Ask, fits, is_list_of, is_whole_page, may_be_reply
from nvscope.tracker.visu.awaited import Early, Happened, Waiting, asked_behind
from nvscope.tracker.visu.early_replies import EarlyReplies
from nvscope.tracker.visu.events import OK
from nvscope.tracker.visu.going_on import Closed
from nvscope.tracker.visu.http_forms import Form, What
from nvscope.tracker.visu.limits import MOST_WAITING
from nvscope.tracker.visu.messages import UNMEASURED_NS, Kind
from nvscope.tracker.visu.reach import NOWHERE, UNKNOWN, Reach, distance
from nvscope.tracker.visu.turns import Turns
from nvscope.tracker.visu.unseen_requests import Answered, UnseenRequests


class Conversation(Struct):
    """One connection; ``is_visu`` from its first request of a WebVisu page on, ``gap_bytes`` are missing until then.

    ``beyond`` requests wait behind those that are ``waiting``: nobody remembers what they ask for. ``left_out`` are
    those of WebVisu pages of which that has not been told yet. ``closed`` is when the client closed its side: what
    waits then may still be answered. ``is_heard``: something that the server sent was captured, ``is_spoken``: the same
    of the client. ``early`` are responses that were captured before the requests that they may answer. ``acknowledged``
    is up to where the server had the client's bytes, while none of them was captured, or -1. ``began`` is the order
    with which the connection did, -1 where nobody remembers it.
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
    early: EarlyReplies = field(default_factory=EarlyReplies)
    began: int = -1
    turns: Turns = field(default_factory=Turns)
    unseen: UnseenRequests = field(default_factory=UnseenRequests)
    # Whether the last thing that happened to each direction was that bytes of it were missing.
    _lacks: list[bool] = field(default_factory=lambda: [False, False])

    def take_from_client(
        self, form: Form, asked: Ask, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None],
        reach: Reach = NOWHERE,
    ) -> None:  # fmt: skip
        """Take what happens in the client's direction."""
        self.unseen.waits &= form.what not in (What.WHOLE, What.CUT, What.PART)
        if form.what in (What.WHOLE, What.CUT):
            if self._is_of_page(form) or asked.request is not None:
                # What is whole and nobody reads is no better known than what is cut.
                kind = Kind.CUT if asked.request is None else Kind.READ
                self._tell_request(kind, asked, order, message, tell)
                self._tell_unbounded(form, order, tell)
            is_head = form.head is not None and form.head.method == "HEAD"
            asked = NOTHING if form.what is What.CUT else asked
            self.turns.pass_rest(reach.begin(form.head_bytes) if form.head_bytes else UNKNOWN)
            self._wait(Waiting(asked, order, arrival_ns, is_head, reach=reach), form, tell)
        elif form.what is What.PART:
            of_page = self._is_of_page(form)
            if of_page:
                self._tell_request(Kind.PART, asked, order, message, tell)
                self._tell_unbounded(form, order, tell)
            # Who breaks off its own request waits for nothing, but for what has come before.
            if form.broken_by is not Side.CLIENT or self.has_early(form, reach):
                self._wait(Waiting(asked if of_page else NOTHING, order, arrival_ns, reach=reach), form, tell)
        elif form.what is What.BROKEN:
            is_known = self.waits or self._is_of_page(form)
            if self._is_of_page(form):
                self._tell_request(Kind.CUT, NOTHING, order, message, tell)
                if form.is_malformed:
                    self._tell_unbounded(form, order, tell)
            waited = self._forget_waiting() - self.early.has_begun
            if self.early.has_begun:
                self.early.take()
            self.turns.miss(reach.acknowledged)
            if self._lacks[0]:
                self.turns.lose_client(reach.behind, waited)
                self._lose_unseen(order, tell, is_known=is_known)
        elif form.what is What.END:
            if form.broken_by is None:
                self.closed = Closed(order, arrival_ns)
                if self.is_heard:
                    self._tell_leaving(Kind.LEFT, order, tell)
        else:
            self._take_other(form, order, tell, reach)
            if form.what is not What.GAP:
                self.turns.begin(began=reach.behind)
        self.is_spoken |= form.what is not What.END
        self._lacks[0] = form.what is What.GAP

    def _lose_unseen(self, order: int, tell: Callable[[Happened], None], *, is_known: bool) -> None:
        """Take that nobody knows what was in a hole, and how much; unless ``is_known``, it may hide a request."""
        self.unseen.waits = False
        if not is_known:
            for _ in range(self.unseen.lose(Answered(one.is_reply, one.reach.acknowledged) for one in self.early)):
                self.tell_unseen(order, tell)

    def tell_unseen(self, order: int, tell: Callable[[Happened], None]) -> None:
        """Tell of a request of a page of which nothing was seen but its reply."""
        self._tell_request(Kind.CUT, NOTHING, order, -1, tell)

    @property
    def waits(self) -> bool:
        """Whether a request waits for its reply."""
        return bool(self.waiting or self.beyond)

    def _is_of_page(self, form: Form) -> bool:
        """Tell whether what is not whole is a request of a page: what says nothing of itself, where others were."""
        return form.touched is Likeness.YES or (form.touched is Likeness.PERHAPS and self.is_visu)

    def _wait(self, one: Waiting, form: Form, tell: Callable[[Happened], None]) -> None:
        others = self.early.reaches()
        if self.early.is_torn and not self.has_early(form, one.reach) and self.early.ends_torn():
            self.turns.lose()
        if not self.turns.ask(one.reach, others):
            # Something in front of it may have to be answered first.
            self._tell_answer(Kind.UNCLEAR, one, one.order, 0, -1, tell)
            self.turns.owed.wait(self._forget_waiting())
            self.early = EarlyReplies()
            return
        if self.beyond or len(self.waiting) >= MOST_WAITING:
            self.beyond += 1
            self.left_out += one.asked.request is not None
        else:
            self.waiting.append(one)

    def _forget_waiting(self) -> int:
        waited, self.beyond = len(self.waiting) + self.beyond, 0
        self.waiting.clear()
        return waited

    def _tell_request(
        self, kind: Kind, asked: Ask, order: int, message: int, tell: Callable[[Happened], None]
    ) -> None:  # fmt: skip
        tell(Happened(kind, self.connection, order, message, asked, 0, 0, self.gap_bytes, not self.is_visu))
        self.is_visu, self.gap_bytes = True, 0

    def take_from_server(
        self, form: Form, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None],
        reach: Reach = NOWHERE,
    ) -> None:  # fmt: skip
        """Take what happens in the server's direction."""
        if form.what is What.ANEW:
            self._take_other(form, order, tell)
        if form.what in (What.ANEW, What.BEGIN):
            self._begin_server(reach, order, tell)
        was_heard, self.is_heard = self.is_heard, self.is_heard or form.what is not What.END
        self._take_from_server(form, order, arrival_ns, message, tell, reach)
        self._lacks[1] = form.what is What.GAP
        if not was_heard and self.is_heard and self.closed is not None:
            self.closed = self.closed._replace(order=order)
            self._tell_leaving(Kind.LEFT, order, tell)

    def _begin_server(self, reach: Reach, order: int, tell: Callable[[Happened], None]) -> None:
        """Take where the server's direction begins: bytes are missing in front that answered what had less of them."""
        begin = reach.behind
        while self.waiting and distance(begin, self.waiting[0].reach.acknowledged) > 0:
            self._tell_answer(Kind.UNCLEAR, self.waiting.popleft(), order, 0, -1, tell)
            self.turns.is_doubtful = not self.waiting
        if self.turns.begin(told=reach.acknowledged):
            self.turns.owed.wait(self._tell_unclear(order, tell))
        self.turns.begin_server(begin)

    def _take_from_server(
        self, form: Form, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None], reach: Reach
    ) -> None:  # fmt: skip
        if form.what in (What.WHOLE, What.CUT):
            if form.head is not None and form.head.is_interim:
                return
            if form.answers_nobody:
                if not form.is_unasked:
                    self._pass_by(reach, form.head_bytes, order, tell)
                return
            is_cut = form.what is What.CUT
            if self.waiting and not self.turns.may_answer(self.waiting[0], reach):
                if self.turns.is_tried and self.turns.shows_more(self.waiting[0], reach):
                    self._pass_by(reach, form.head_bytes, order, tell, is_other=True)
                return
            if self.waiting and not is_cut and self.turns.refutes(may_be_reply(self.waiting[0].asked, form)):
                self._pass_by(reach, form.head_bytes, order, tell, is_other=True)
                return
            if form.is_late and not is_cut and self.waiting and not fits(self.waiting[0].asked, form):
                self._doubt(order, tell)
            if self.waiting:
                asked = self.waiting.popleft()
                self.turns.answer(asked.reach.acknowledged, reach.behind)
                if asked.asked.is_file:
                    self._tell_file(form, asked, order, arrival_ns, message, tell)
                elif is_cut:
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
            else:
                self.turns.owed.pass_by(reach)
        elif form.what is What.BROKEN:
            in_turns = self._lacks[1] and not (self.turns.overlap or self.beyond)
            later = asked_behind(self.waiting, reach.behind) if in_turns else []
            if len(self.waiting) > len(later) and form.touched is Likeness.YES:
                asked = self.waiting[0]
                self.turns.answer(asked.reach.acknowledged, UNKNOWN)
                self._tell_file(form, asked, order, arrival_ns, message, tell)
                self._tell_answer(Kind.CUT, asked, order, arrival_ns, message, tell)
                if form.is_malformed and asked.asked.request is not None:
                    self._tell_unbounded(form, order, tell)
            elif not later:
                self._tell_leaving(Kind.UNCLEAR, order, tell)
            waited = self._forget_waiting()
            self.waiting.extend(later)
            if self._lacks[1]:
                self.turns.miss_server(reach.behind, None if later else waited)
                # What has come before is known to answer the next request; else nobody knows how much is missing.
                self.early.is_torn = bool(self.early) and not later
                if not (self.early or later):
                    self.turns.lose()
        elif form.what is What.END:
            if form.is_replaced:
                self._tell_unclear(order, tell)
            else:
                self._tell_unanswered(order, arrival_ns, tell, by_client=form.broken_by is Side.CLIENT)
        elif form.what is What.PART:
            if self.waiting and not form.answers_nobody:
                self._tell_file(form, self.waiting[0], order, arrival_ns, message, tell)
        elif form.what is not What.ANEW:
            self._take_other(form, order, tell)

    def _pass_by(
        self, reach: Reach, head_bytes: int, order: int, tell: Callable[[Happened], None], *, is_other: bool = False
    ) -> None:  # fmt: skip
        """Take that a response with such a head answers nobody, or what was asked by a client that had none of it.

        ``is_other``: it shows that it answers none that waits in front.
        """
        begin = reach.begin(head_bytes)
        self.turns.owed.pass_by(reach)
        self.turns.pass_by(begin)
        had = (one.reach.acknowledged for one in self.waiting)
        if is_other or any(begin == UNKNOWN or (one != UNKNOWN and distance(begin, one) >= 0) for one in had):
            # What such a response answers is one more.
            self.turns.owed.wait(self._tell_unclear(order, tell) + is_other)
            self.turns.lose()

    def _tell_file(
        self, form: Form, asked: Waiting, order: int, arrival_ns: int, message: int, tell: Callable[[Happened], None]
    ) -> None:  # fmt: skip
        """Tell what came in place of a list of variables, if it is one (``is_list_of``); and a page that is whole."""
        is_page = is_whole_page(asked.asked, form)
        if is_page or is_list_of(asked.asked, form, is_visu=self.is_visu):
            after_ns, frame = arrival_ns - asked.arrival_ns, asked.order >> ORDER_BITS
            kind = Kind.PAGE if is_page else Kind.NAMES
            tell(Happened(kind, self.connection, order, message, asked.asked, after_ns, frame, 0, False))

    def _doubt(self, order: int, tell: Callable[[Happened], None]) -> None:
        """Take that a response may answer a request from before the capture: so may those that follow."""
        for place, one in enumerate(self.waiting):
            if one.asked.request is not None:
                self._tell_answer(Kind.UNCLEAR, one, order, 0, -1, tell)
                self.waiting[place] = one._replace(asked=NOTHING)

    def copy(self) -> Conversation:
        """Return another one that is as this one is, of which nobody knows what the requests that wait ask for."""
        waiting = deque(one._replace(asked=NOTHING) for one in self.waiting)
        early, turns, unseen = self.early.copy(), self.turns.copy(), replace(self.unseen)
        return replace(self, waiting=waiting, early=early, turns=turns, unseen=unseen, _lacks=[*self._lacks])

    def has_early(self, form: Form, reach: Reach) -> bool:
        """Tell whether a request was answered before it was whole."""
        return self.early.fit(reach, knows_head=form.head_bytes > 0, acknowledges=self.turns.acknowledges)

    def keep(self, early: Early) -> None:
        """Keep a response that may answer a request that is still to come."""
        self._lacks[1] &= early.is_lost
        if not early.has_begun:
            self.turns.owed.pass_by(early.reach)
        if not self.early.keep(early):
            self.turns.pass_by(early.reach.begin(early.form.head_bytes))

    def answer_early(self, order: int, message: int, tell: Callable[[Happened], None]) -> None:
        """Take that the request is whole, with an order, that was answered before; the response is a message now."""
        form, arrival_ns, reach, has_begun, _, is_lost = self.early.take()
        if self.early.ends_torn():
            self.turns.lose()
        if self.waiting:
            self.waiting[0] = self.waiting[0]._replace(is_early=True)
            # What answers a request that has begun may be sent before any more of that is there.
            reach = NOWHERE if is_lost else reach._replace(acknowledged=UNKNOWN) if has_begun else reach
            self.take_from_server(form, order, arrival_ns, message, tell, reach)

    def note_acknowledged(self, acknowledged: int) -> None:
        """Note up to where the client has bytes of the server, of which none was captured, with its last request."""
        self.waiting[-1] = self.waiting[-1]._replace(acknowledged=acknowledged)

    def miss_reply(self, order: int, size: int, tell: Callable[[Happened], None]) -> None:
        """Take that the server has sent bytes that were not captured: the reply to the first request is among them."""
        self._take_other(Form(What.GAP, missing_bytes=size), order, tell)
        self._tell_answer(Kind.CUT, self.waiting[0], order, 0, -1, tell)
        self._forget_waiting()

    def miss_request(self, order: int, size: int, tell: Callable[[Happened], None]) -> None:
        """Take that the client has sent bytes that were not captured, a request of a page among them."""
        self._take_other(Form(What.GAP, missing_bytes=size), order, tell, NOWHERE)
        self.tell_unseen(order, tell)

    def _tell_unbounded(self, form: Form, order: int, tell: Callable[[Happened], None]) -> None:
        if form.is_endless:
            tell(Happened(Kind.UNBOUNDED, self.connection, order, -1, NOTHING, 0, 0, 0, False))

    def _tell_leaving(self, kind: Kind, order: int, tell: Callable[[Happened], None]) -> None:
        """Tell what waits while its client is leaving: it has closed its side."""
        if self.closed is not None:
            for asked in self.waiting:
                self._tell_answer(kind, asked, order, self.closed.arrival_ns, -1, tell)

    def give_up(self, order: int, tell: Callable[[Happened], None], lacks: Callable[[int], bool]) -> bool:
        """Take that the client, which has closed its side, waits for nothing any more; return whether it did."""
        assert self.closed is not None
        self.miss_replies(order, tell, lacks)
        is_left = bool(self.waiting)
        self._tell_unanswered(order, self.closed.arrival_ns, tell, by_client=True)
        return is_left

    def miss_replies(self, order: int, tell: Callable[[Happened], None], lacks: Callable[[int], bool]) -> None:
        """Take that a reply may be missing to what ``lacks`` tells of by what its client had, or was nobody's."""
        was_said = self.turns.owed.may_have_answered
        for one in [one for one in self.waiting if lacks(had := one.reach.acknowledged) or was_said(had)]:
            self.waiting.remove(one)
            self._tell_answer(Kind.UNCLEAR, one, order, 0, -1, tell)

    def _tell_unclear(self, order: int, tell: Callable[[Happened], None]) -> int:
        """Take that nobody knows whether what waits was answered: the capture lacks what would tell it."""
        for asked in self.waiting:
            self._tell_answer(Kind.UNCLEAR, asked, order, 0, -1, tell)
        return self._forget_waiting()

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
            return
        if kind is Kind.CUT:
            frame = asked.order >> ORDER_BITS
            tell(Happened(kind, self.connection, order, message, NOTHING, 0, frame, 0, False))
            return
        latency_ns = arrival_ns - asked.arrival_ns if kind in (Kind.REPLY, Kind.GIVEN_UP, Kind.LEFT) else 0
        latency_ns = UNMEASURED_NS if kind is Kind.REPLY and asked.is_early else latency_ns
        frame = asked.order >> ORDER_BITS
        tell(Happened(kind, self.connection, order, message, asked.asked, latency_ns, frame, 0, False))

    def _take_other(self, form: Form, order: int, tell: Callable[[Happened], None], reach: Reach | None = None) -> None:
        if form.what is What.ANEW:
            self._forget_waiting()
            self.is_visu, self.gap_bytes, self.closed = False, 0, None
            self.early = EarlyReplies()
            self.turns, self.unseen = Turns(), UnseenRequests()
            self.is_heard, self.is_spoken, self.acknowledged, self.began = False, False, UNKNOWN, order
        elif form.what is What.GAP:
            if reach is not None:  # they are the client's
                self.unseen.miss(reach.behind, form.missing_bytes)
            if self.is_visu or reach is not None:
                kind = Kind.REPLY_GAP if reach is None else Kind.GAP if self.is_visu else Kind.HIDDEN
                tell(Happened(kind, self.connection, order, -1, NOTHING, 0, 0, form.missing_bytes, False))
            else:
                self.gap_bytes += form.missing_bytes
