"""Which response may answer which request, by what their segments acknowledge, and where nobody knows it.

Readings, where the rules leave a choice:

- a response is no answer to a request whose head its server does not acknowledge with the segment with which the
  response is whole; where none waits that it may answer, it is nobody's. That counts from the first response of a
  connection on of which the server acknowledges the head of what it answers: some captures are made up
- a response that comes while none waits is kept for the next request, if the server acknowledges the head of that; of
  those the four last ones, each for one request
- where the server's direction begins behind what a client acknowledged with a request that waits, nobody knows what
  answered that
- where bytes are missing and a direction loses step with that, nobody knows how many requests wait: of the next request
  nobody knows what answers it, unless its client had more then than with any request before, than in front of the
  missing bytes, and than up to the end of the last response that answered something: then it had waited for replies.
  That is so with each request up to the first one that is in step. One that acknowledges nothing is
- of a client that sent several with the same acknowledgement, nobody knows it of the first request behind missing bytes
  of its own, either: the first of its turn may be missing
- what waits and was asked for by a client that had the bytes of the server's which are missing, as had been when it
  takes turns, is answered by what comes behind them: it goes on waiting, and is not doubtful. What the client had all
  of before it asked is no answer to it, even if it is captured later
- of a client that sent more when it had more than with the request before, and not all of what answered that, nobody
  knows for the rest of the connection
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Lost, Message
    from tests.oracle.rules.visu_talk import Talk, Waiting

MOST_EARLY = 4


def behind(one: int | None, other: int | None) -> int | None:
    """Return how far a sequence number is behind another one, None where nobody knows."""
    return None if one is None or other is None else (one - other + 2**31) % 2**32 - 2**31


def last(one: int | None, other: int | None) -> int | None:
    """Return the later one of two sequence numbers."""
    if one is None or other is None:
        return other if one is None else one
    return one if (behind(one, other) or 0) >= 0 else other


def may_answer(response: Message, request: Message) -> bool | None:
    """Tell whether a response may answer a request; None where nobody knows."""
    distance = behind(response.told, request.head_at)
    return None if distance is None else distance >= 0


@dataclass
class Turns:
    """What a client had of the server's bytes, of one connection."""

    asked: list[int | None] = field(default_factory=list)
    """With each request, and in front of each hole."""
    answers: list[tuple[int | None, int | None]] = field(default_factory=list)
    """What the client had with each request that was answered, and where its answer ends."""
    begin: int | None = None
    """Where the server's direction begins."""
    doubtful: bool = False
    requests: list[int] = field(default_factory=list)
    """With each request that says so."""
    several: bool = False
    lost: bool = False
    """Whether the client lost bytes since its last request."""
    acknowledges: bool = False

    def takes_turns(self) -> bool:
        for (had_before, end), (had, _) in zip(self.answers, self.answers[1:], strict=False):
            if (behind(had, had_before) or 0) > 0 and (behind(end, had) or 0) > 0:
                return False
        return True

    def ask(self, request: Message) -> bool:
        """Take a request; return whether the next response answers it, or what waits in front of it."""
        lost, self.lost = self.lost, False
        if request.told is not None:
            self.several |= self.requests[-1:] == [request.told]
            self.requests.append(request.told)
        if self.doubtful and request.told is not None:
            known: int | None = None
            for one in [*self.asked, self.begin, *(end for _, end in self.answers)]:
                known = last(known, one)
            unsure = not self.takes_turns() or (lost and self.several)
            self.doubtful = known is not None and (unsure or (behind(request.told, known) or 0) <= 0)
        elif request.told is None:
            self.doubtful = False
        self.asked.append(request.told)
        return not self.doubtful

    def answers_first(self, response: Message, request: Message, *, is_behind: bool) -> bool:
        """Tell whether a response answers the first request that waits, behind missing bytes or not."""
        ahead = behind(response.behind, request.told)
        if is_behind and ahead is not None and ahead <= 0:
            return False
        may = may_answer(response, request)
        self.acknowledges |= may is True
        if may is False and self.acknowledges:
            return False
        self.answers.append((request.told, response.behind))
        return True


def begin_servers(talks: Iterable[Talk]) -> None:
    """Take where servers' directions begin, as far as they have begun since."""
    for talk in talks:
        begin_server(talk)


def begin_server(talk: Talk) -> None:
    begin = talk.connection.directions[False].begin
    if begin is None or talk.turns.begin is not None:
        return
    talk.turns.begin = begin
    while talk.waiting and (behind(begin, talk.waiting[0].message.told) or 0) > 0:
        talk.happened["answered by what is missing"] += 1
        talk.waiting.pop(0)
        talk.turns.doubtful = not talk.waiting


def lose_client(talk: Talk, what: Lost) -> None:
    """Take that the client's direction lost step."""
    if talk.early and talk.early[0].told is None:
        talk.early.pop(0)
    talk.turns.asked.append(what.told)
    talk.turns.doubtful |= what.missing
    talk.turns.lost |= what.missing
    talk.be_wary()


def asked_behind(talk: Talk, what: Lost) -> list[Waiting]:
    """Return what waits and was asked for behind the bytes of the server that are missing."""
    if not what.missing or not talk.turns.takes_turns():
        return []
    had = [behind(one.message.told, what.behind) for one in talk.waiting]
    first = next((place for place, one in enumerate(had) if one is not None and one >= 0), len(had))
    for one in talk.waiting[first:]:
        one.is_behind = True
    return talk.waiting[first:]


def wait(talk: Talk, one: Waiting) -> None:
    """Have a request wait, if it is known what answers it."""
    if talk.turns.ask(one.message):
        talk.waiting.append(one)
        return
    talk.happened["nobody knows what answers it"] += 1
    talk.waiting.clear()
    talk.early.clear()


def has_early(talk: Talk, request: Message) -> bool:
    """Tell whether a request was answered before; what answers none that is still to come is not kept."""
    while talk.early and talk.early[0].told is not None and not may_answer(talk.early[0], request):
        talk.early.pop(0)
    return bool(talk.early)


def keep(talk: Talk, response: Message) -> bool:
    """Keep a response that comes while none waits, if it may answer one that has begun, or is still to come."""
    if not talk.early and True in talk.readers and talk.readers[True].begun:
        talk.happened["early response"] += 1
        response.told = None
        talk.early.append(response)
        return True
    if response.told is None:
        return False
    talk.early = [*talk.early, response][-MOST_EARLY:]
    return True
