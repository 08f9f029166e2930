"""Waiting requests: what a response answers, as far as that says where messages end.

A response has no body, whatever it says, where it answers HEAD (RFC 9110, section 9.3.2). And a request that does not
say how long it is ends at the latest where it is answered; one that says so may be answered early, before it is whole.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from typing import NamedTuple, Protocol

from dissectors.batch import I64
from nvscope.tracker.pieces import NEVER, PieceKind, Pieces
from nvscope.tracker.segments import WRAP
from nvscope.tracker.visu.asking import NOTHING
from nvscope.tracker.visu.awaited import Early, Happened
from nvscope.tracker.visu.conversation import Conversation
from nvscope.tracker.visu.http_forms import Form, Forms, What
from nvscope.tracker.visu.reach import NOWHERE, UNKNOWN, Reach


class Waiting(NamedTuple):
    """The requests of a connection that wait in front of a batch, as ``conversation`` knows them, which may change.

    ``first`` is the order of the first of them, and up to where its client had the server's bytes then, where none of
    these was captured.
    """

    conversation: Conversation
    first: tuple[int, int] | None = None


class Missed(Protocol):
    """Tells of a connection since when it is known that replies of a server were missed of which nothing was heard."""

    def acknowledged(self, order: int) -> int:
        """Return up to where the client acknowledges the server's bytes with an order."""
        ...

    def by(self, order: int, acknowledged: int, before: int) -> int:
        """Return with which order a reply was missed to what was asked with one; ``NEVER`` without any before."""
        ...


class Asked(NamedTuple):
    """What the client's direction shows with an order; and with which one the head was there, if it is a request."""

    order: int
    form: Form
    head_order: int = NEVER
    reach: Reach = NOWHERE


def asked_at(found: Forms, places: Sequence[int], piece: I64, pieces: Pieces, ends: I64) -> list[Asked]:
    """Return what was found of a client's direction at some places, and with which pieces."""
    asked = []
    columns = pieces.order, pieces.behind, ends, pieces.acknowledged, pieces.kind, pieces.stream
    rows = zip(*(column[piece].tolist() for column in columns), strict=True)
    for place, (order, behind, end, acknowledged, kind, stream) in zip(places, rows, strict=True):
        form, at, reach = found.forms[found.form[place]], found.at[place], NOWHERE
        if kind != PieceKind.END and not stream & 1:  # as ``Reaches`` are
            first = behind - (end - at if at >= 0 else 0)
            reach = Reach(first % WRAP, (first + form.body_bytes) % WRAP, acknowledged)
        asked.append(Asked(order, form, reach=reach))
    return asked


class Unheard:
    """What a client's direction shows while its server is not heard, and where replies to it were missed.

    ``waiting`` is what waits in front of a batch, ``begins`` are the orders with which the server's direction begins in
    it: more than once where several connections follow each other between the same ends. Nobody knows any more what
    waits where a reply was missed (``Conversation.miss_reply``).
    """

    def __init__(self, waiting: Waiting, missed: Missed, begins: Sequence[int]) -> None:
        self._missed, self._begins = missed, begins
        self._heard_at = -1 if waiting.conversation.is_heard else begins[0]
        self._waits, self._order = waiting.first is not None, NEVER
        if waiting.first is not None:
            self._order = missed.by(*waiting.first, self._heard_at)

    def take(self, asked: Iterable[Asked]) -> list[Asked]:
        """Return more of what the client's direction shows, with where nobody knows any more what waits."""
        found: list[Asked] = []
        for one in asked:
            found += self.up_to(one.order)
            if one.form.what in (What.BROKEN, What.ANEW):
                self._order, self._waits = NEVER, False
            elif one.form.what in (What.WHOLE, What.CUT, What.PART) and not self._waits and one.order < self._heard_at:
                self._waits = True
                self._order = self._missed.by(one.order, self._missed.acknowledged(one.order), self._heard_at)
            if one.form.what is What.ANEW:
                self._heard_at = next((begin for begin in self._begins if begin > one.order), NEVER)
            found.append(one)
        return found

    def up_to(self, before: int) -> list[Asked]:
        """Return what is missed in front of an order, and has not been returned."""
        if self._order >= before:
            return []
        order, self._order, self._waits = self._order, NEVER, False
        return [Asked(order, Form(What.BROKEN))]


class Ended(Enum):
    """What is answered where no whole request waits: nothing, one that has begun, or one that ends with that."""

    NOTHING = 0
    BEGUN = 1
    OPEN = 2


class WaitingRequests:
    """The requests of a connection that wait while a batch of what its server sends is read.

    ``waiting`` are those before it. ``asked`` is what the client's direction shows in the batch (orders are those of
    ``nvscope.tracker.pieces``), ``begun`` with which order the head was there of what is not whole behind that.
    ``ends`` are where ``pieces`` end in the data that is read. ``answers_more`` is called with a place of the data
    where something comes that answers a request, and none waits; it tells what that is. ``begins_head`` tells by such a
    place whether what has begun is HEAD.
    """

    def __init__(
        self, waiting: Waiting, asked: Iterable[Asked], ends: I64, pieces: Pieces,
        answers_more: Callable[[int], Ended] | None = None, begun: int = NEVER,
        begins_head: Callable[[int], bool] = lambda _: False,
    ) -> None:  # fmt: skip
        self._talk, self._begun = waiting.conversation, begun
        self._asked = deque(asked)
        self._ends, self._pieces = ends, pieces
        self._answers_more, self._begins_head = answers_more, begins_head

    def ask(self, asked: Iterable[Asked]) -> None:
        """Take more of what the client's direction shows."""
        self._asked.extend(asked)

    def begin(self, at: int, form: Form) -> None:
        """Take the begin of the server's direction, ``form`` says which."""
        order = self._go_on(at)
        self._talk.take_from_server(form, order, 0, -1, _tell_nobody, self._reach(at))

    def answers_head(self, at: int) -> bool:
        """Tell whether the response whose head ends at a place of the data answers HEAD, which waits or has begun."""
        order = self._go_on(at)
        if self._talk.waiting:
            return self._talk.waiting[0].is_head
        if self._talk.beyond or self._talk.early.has_begun:
            return False
        asked = self._first_asked()
        if asked is not None:
            return asked.head_order < order and _is_head(asked.form)
        return (self._answers_more is not None or self._begun < order) and self._begins_head(at)

    def _first_asked(self) -> Asked | None:
        """Return what the client's direction shows next."""
        return next((one for one in self._asked if one.form.what is not What.GAP), None)

    def answered(self, at: int, begin: int, behind: int, *, to_nobody: bool = False) -> None:
        """Take the end of a response, or of one that answers nobody; ``at`` is the place with which that is known."""
        order, reach = self._go_on(at), self._reach(at, begin, behind)
        if to_nobody or self._talk.waits:
            self._talk.take_from_server(_TO_NOBODY if to_nobody else _RESPONSE, order, 0, -1, _tell_nobody, reach)
            return
        what = self._answers(at, order)
        if what is Ended.OPEN:
            self._take_asked(Asked(order, _OPEN))
            self._talk.take_from_server(_RESPONSE, order, 0, -1, _tell_nobody, reach)
        elif what is Ended.BEGUN or (what is Ended.NOTHING and reach.acknowledged != UNKNOWN):
            self._talk.keep(Early(_RESPONSE, 0, reach, what is Ended.BEGUN))

    def lost(self, at: int) -> None:
        """Take that there was a response of which bytes are missing, or that nobody reads."""
        order = self._go_on(at)
        what = Ended.NOTHING if self._talk.waits else self._answers(at, order)
        if what is Ended.OPEN:
            self._take_asked(Asked(order, _OPEN))
        elif what is Ended.BEGUN:
            is_missing = self._pieces.kind[self._piece(at)] == int(PieceKind.HOLE)
            reach = self._reach(at) if is_missing else NOWHERE
            self._talk.keep(Early(_RESPONSE, 0, reach, has_begun=True, is_lost=True))

    def _answers(self, at: int, order: int) -> Ended:
        """Return what a response answers where no request waits that is whole; a request may end with that."""
        asked = self._first_asked()
        if asked is None and self._answers_more is not None:
            what = self._answers_more(at)
        else:
            has_begun = (self._begun if asked is None else asked.head_order) < order
            what = Ended.BEGUN if has_begun else Ended.NOTHING
        return Ended.NOTHING if what is Ended.BEGUN and self._talk.early else what

    def ended(self, at: int) -> None:
        """Take that the server has closed its side: what has not been answered never is."""
        self._go_on(at)
        if not self._talk.waits and self._answers_more is not None:
            self._answers_more(at)

    def forget(self, at: int) -> None:
        """Take that the server's direction loses step, or ends."""
        order = self._go_on(at)
        kind = self._pieces.kind[~at] if at < 0 else int(PieceKind.DATA)
        if kind == int(PieceKind.HOLE):
            self._talk.take_from_server(_GAP, order, 0, -1, _tell_nobody)
        form = _END if kind == int(PieceKind.END) else _BROKEN
        self._talk.take_from_server(form, order, 0, -1, _tell_nobody, self._reach(at))

    def _go_on(self, at: int) -> int:
        """Take what the client shows in front of a place of the data; return the order of that."""
        order = int(self._pieces.order[self._piece(at)])
        while self._asked and self._asked[0].order < order:
            self._take_asked(self._asked.popleft())
        return order

    def _take_asked(self, one: Asked) -> None:
        talk = self._talk
        talk.take_from_client(one.form, NOTHING, one.order, 0, -1, _tell_nobody, one.reach)
        is_request = one.form.what in (What.WHOLE, What.CUT, What.PART)
        if is_request and talk.has_early(one.form, one.reach):
            talk.answer_early(one.order, -1, _tell_nobody)

    def _piece(self, at: int) -> int:
        return ~at if at < 0 else int(self._ends.searchsorted(at))

    def _reach(self, at: int, begin: int | None = None, behind: int | None = None) -> Reach:
        """Return where something lies that is known with a place of the data, where it begins in that, and ends."""
        pieces, piece = self._pieces, self._piece(at)
        if pieces.kind[piece] == int(PieceKind.END):
            return NOWHERE
        first = int(pieces.behind[piece]) - (int(self._ends[piece]) if at >= 0 else at)
        body_at, behind = (first + (at if one is None else one) for one in (begin, behind))
        return Reach(body_at % WRAP, behind % WRAP, int(pieces.acknowledged[piece]))


_RESPONSE, _GAP, _BROKEN, _END = (Form(what) for what in (What.WHOLE, What.GAP, What.BROKEN, What.END))
_OPEN = Form(What.WHOLE)
"""A request that ends where it is answered: nobody knows where it lies."""
_TO_NOBODY = Form(What.WHOLE, answers_nobody=True)


def _tell_nobody(_: Happened) -> None:
    """Tell nobody: what happened is told where the messages of both directions are known."""


def _is_head(form: Form) -> bool:
    return form.head is not None and form.head.method == "HEAD"
