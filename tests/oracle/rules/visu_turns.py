"""Which response may answer which request, by what their segments acknowledge, and where nobody knows it.

Readings, where the rules leave a choice:

- a response is no answer to a request whose head its server does not acknowledge with the segment with which the
  response is whole; where none waits that it may answer, it is nobody's. That counts from the first response of a
  connection on of which the server acknowledges the head of what it answers: some captures are made up
- a response that comes while none waits is kept for the next request, if the server acknowledges the head of that; of
  those the four last ones, each for one request. Where the server loses step by missing bytes behind these, no more are
  kept before they have answered something, and nobody knows how many requests wait when none of them is left
- one that comes while a request is being received, of which the head is there, answers that, unless the server does not
  acknowledge the head with it, though it has done so with others, or though the client had all of it when it asked;
  what is missing in its place does, unless the client had all of that
- where the server's direction begins behind what a client acknowledged with a request, nobody knows what answers that,
  whether it waits then or is known only later, until its client had that much
- while requests wait of which nobody knows what answers them (``visu_owed``), none is in step
- where bytes are missing and a direction loses step with that, nobody knows how many requests wait: of the next request
  nobody knows what answers it, unless its client had more then than with any request before, than in front of the
  missing bytes, and than up to the end of the last response that answered something: then it had waited for replies.
  That is so with each request up to the first one that is in step. One that acknowledges nothing is
- nor is that known of a request whose client had less than up to the end of the last bytes with which its server lost
  step; nor of one whose client had no more than up to the end of a response that answers nothing, and that the server
  sent when it did not have all that is missing of the client
- of a client that sent several with the same acknowledgement, nobody knows it of the first request behind missing bytes
  of its own, either: the first of its turn may be missing. That counts, too, where the rest of a request lies between
  these and the first one. Nor of the first one behind these of which the next one, in front of any answer, shows that:
  then nobody knows it of both. It is not missing where the client had a response, that answers nothing, which the
  server sent when it had all that is missing, and such a rest
- where a response answers nobody, since the client lost step while it came, it may be that to what waits, if the client
  had nothing of it when it asked: then nobody knows what answers anything that waits
- bytes of a client are missing in front of where its direction begins, if its server had less with the first segment of
  its own, by 1 MiB at most
- what waits and was asked for by a client that had the bytes of the server's which are missing, as had been when it
  takes turns, is answered by what comes behind them: it goes on waiting, and is not doubtful; but where more than one
  request waits in front of it, nobody knows whether they were all answered
- what the client had all of before it asked is no answer to it, even if it is captured later: where bytes of the server
  are missing that the client had, or the server has not the head, or has acknowledged the head of what it answers
- of a client that sent more when it had more than with the request before, and not all of what answered that, nobody
  knows for the rest of the connection
- where bytes are missing and a direction lost step with that, a reply of 200 that cannot be the one to what it is
  paired with (another number of values, or several fields in place of what a write is answered with) answers something
  else, unless three have fitted since: then nobody knows what answers anything that waits. So does a response whose
  server had not the head of the first that waits, and of which the client had not all when it asked. A query is fitted
  by whatever is said; what has another number of variables than it says, or nobody knows which, by nothing
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tests.oracle.rules import visu_body
from tests.oracle.rules.visu_owed import OFTEN, Owed, waited_for_several

if TYPE_CHECKING:
    from tests.oracle.rules.http_message import Lost, Message
    from tests.oracle.rules.visu_talk import Talk, Waiting

MOST_EARLY, NEAR = 4, 2**20


def behind(one: int | None, other: int | None) -> int | None:
    """Return how far a sequence number is behind another one, None where nobody knows."""
    return None if one is None or other is None else (one - other + 2**31) % 2**32 - 2**31


def has(told: int | None, end: int | None) -> bool:
    """Tell whether who says so has all up to an end; half of all numbers away is neither in front nor behind."""
    ahead = behind(end, told)
    return ahead is not None and -(2**31) < ahead <= 0


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
    lost_at: int | None = None
    """Where the last bytes end that are missing of the client."""
    rest: bool = False
    """Whether a request ends there, in front of the first one that is known."""
    missing_at: int | None = None
    """The same of the server, or the end of a response that answers nobody."""
    guessed: int | None = None
    """What the client had with the first request behind missing bytes, if it is in step when sent alone."""
    client_begin: int | None = None
    owed: Owed = field(default_factory=Owed)
    acknowledges: bool = False
    fitted: int = OFTEN
    """How many replies have fitted what they answered since bytes were missing."""

    def takes_turns(self) -> bool:
        for (had_before, end), (had, _) in zip(self.answers, self.answers[1:], strict=False):
            if (behind(had, had_before) or 0) > 0 and (behind(end, had) or 0) > 0:
                return False
        return True

    def ask(self, request: Message, early: Iterable[Message] = ()) -> bool:
        """Take a request; return whether the next response answers it, or what waits in front of it.

        ``early`` are the responses that have answered nothing.
        """
        lost, self.lost = self.lost, False
        if lost and (behind(request.begin_at, self.lost_at) or 0) > 0:
            self.lost_at, self.rest = request.begin_at, True
        guessed, self.guessed = self.guessed, None
        if request.told is not None:
            self.several |= self.requests[-1:] == [request.told]
            self.requests.append(request.told)
            self.doubtful |= guessed == request.told
            if not any(has(one, self.begin) for one in [*self.asked, request.told]):
                self.doubtful |= (behind(self.begin, request.told) or 0) > 0
        if self.doubtful and request.told is not None:
            known: int | None = None
            for one in [*self.asked, self.begin, *(end for _, end in self.answers)]:
                known = last(known, one)
            at_once = lost and self.owed.answered_at_once(request.told)
            self.several |= at_once or (lost and request.told == known)
            all_answered = last(self.begin, None)
            for _, end in self.answers:
                all_answered = last(all_answered, end)
            waits = not self.several or waited_for_several(self.answers) >= OFTEN
            left = self.owed.any_left(request.told, all_answered, hole_has_all=waits)
            for response in early:
                ahead, with_missing = behind(response.behind, request.told), behind(response.told, self.lost_at)
                if with_missing is not None and with_missing < 0:
                    known = last(known, response.behind)
                elif with_missing is not None and ahead is not None and ahead <= 0:
                    lost = False
            unsure = (
                not self.takes_turns()
                or left
                or at_once
                or (lost and (self.several or self.rest))
                or (behind(request.told, self.missing_at) or 0) < 0
            )
            self.doubtful = known is not None and (unsure or (behind(request.told, known) or 0) <= 0)
            if lost and not self.doubtful:
                self.guessed = request.told
            if self.doubtful:
                self.owed.requests += 1
            else:
                self.owed = Owed(counted=request.told, later=[end for end, _ in self.owed.passed])
        elif request.told is None:
            self.doubtful = False
        self.asked.append(request.told)
        return not self.doubtful

    def may_be_first(self, response: Message, request: Message, *, is_behind: bool) -> bool:
        """Tell whether a response may answer the first request that waits, behind missing bytes or not."""
        may = may_answer(response, request)
        has_all = has(request.told, response.behind) and not response.early
        if has_all and (is_behind or may is False or self.acknowledges):
            return False
        self.acknowledges |= may is True
        return not (may is False and self.acknowledges)

    def answer(self, response: Message, request: Message) -> None:
        """Take that a response answers a request."""
        self.guessed = None
        self.owed.passed = [one for one in self.owed.passed if one[0] != response.behind]
        self.answers.append((request.told, response.behind))


def begin(talks: Iterable[Talk]) -> None:
    """Take where directions begin, as far as they have begun since."""
    for talk in talks:
        begin_client(talk)
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
    if miss_begin(talk):
        talk.turns.owed.requests += len(talk.waiting)
        talk.waiting.clear()


def begin_client(talk: Talk) -> None:
    """Take where the client's direction begins, if it has begun since."""
    begin = talk.connection.directions[True].begin
    if begin is not None and talk.turns.client_begin is None:
        talk.turns.client_begin = begin
        miss_begin(talk)


def miss_begin(talk: Talk) -> bool:
    """Tell whether bytes are missing in front of the begin of the client, as that of its server shows."""
    turns = talk.turns
    ahead = behind(turns.client_begin, talk.connection.directions[False].first_told)
    if turns.begin is None or ahead is None or not 0 < ahead <= NEAR:
        return False
    talk.happened["begin of a client that is missing"] += 1
    turns.owed.requests += not turns.lost
    turns.doubtful, turns.lost, turns.fitted = True, not turns.requests, 0
    turns.lost_at, turns.rest = turns.client_begin, False
    return True


def lose_client(talk: Talk, what: Lost) -> None:
    """Take that the client's direction lost step."""
    answered = bool(talk.early) and talk.early[0].told is None
    if answered:
        talk.early.pop(0)
    if what.missing:
        talk.turns.owed.requests += len(talk.waiting) - answered + (not talk.turns.lost)
    talk.turns.asked.append(what.told)
    talk.turns.doubtful |= what.missing
    talk.turns.lost |= what.missing
    if what.missing:
        talk.turns.lost_at, talk.turns.rest, talk.turns.fitted = what.behind, False, 0
    talk.be_wary()


def lose_server(talk: Talk, what: Lost, later: list[Waiting], waited: int) -> None:
    """Take that the server's direction lost step, while so many ``waited``; ``later`` waits for what comes behind."""
    if what.missing:
        if not later:
            talk.turns.owed.requests += waited
            talk.turns.owed.lose(what.behind)
        talk.turns.missing_at, talk.turns.fitted = what.behind, 0
        talk.torn = bool(talk.early and not later)
        talk.turns.doubtful |= not (talk.early or later)


def note_passed(talk: Talk, response: Message) -> int | None:
    """Note that a response may answer a request whose client had nothing of it; return where it begins."""
    begin = response.head_at if response.begin_at is None else response.begin_at
    if begin is not None:
        talk.turns.missing_at = last(talk.turns.missing_at, (begin + 1) % 2**32)
    return begin


def passes_by(talk: Talk, message: Message, *, forgotten: bool) -> bool:
    """Tell whether a response answers nobody; where it may be for what waits, nobody knows what answers that."""
    if message.unasked or not forgotten or not message.whole or message.part or 100 <= message.status < 200:
        return message.unasked
    talk.happened["response to a forgotten request"] += 1
    talk.turns.owed.pass_by(message.behind, message.told)
    begin = note_passed(talk, message)
    had = [one.message.told for one in talk.waiting]
    if any(begin is None or ((behind(begin, one) or 0) >= 0 and one is not None) for one in had):
        talk.turns.owed.requests += len(talk.waiting)
        talk.waiting.clear()
        talk.turns.doubtful = True
    return True


def asked_behind(talk: Talk, what: Lost) -> list[Waiting]:
    """Return what waits and was asked for behind the bytes of the server that are missing."""
    if not what.missing or not talk.turns.takes_turns():
        return []
    had = [has(one.message.told, what.behind) for one in talk.waiting]
    first = had.index(True) if True in had else len(had)
    if first > 1:
        return []
    for one in talk.waiting[first:]:
        one.is_behind = True
    return talk.waiting[first:]


def pass_all_by(talk: Talk, response: Message) -> None:
    """Take that a response answers something in front of all that waits, so that nobody knows what answers that."""
    talk.happened["response to what is missing in front"] += 1
    talk.turns.owed.pass_by(response.behind, response.told)
    note_passed(talk, response)
    talk.turns.owed.requests += len(talk.waiting) + 1
    talk.waiting.clear()
    talk.turns.doubtful = True


def answers_first(talk: Talk, response: Message) -> bool:
    """Take a response while something waits; return whether it answers the first of that, which is noted."""
    first, turns = talk.waiting[0], talk.turns
    if not turns.may_be_first(response, first.message, is_behind=first.is_behind):
        talk.happened["response to what was not captured"] += 1
        has_all = has(first.message.told, response.behind) and not response.early
        lacks_some = first.message.told == response.behind and (behind(response.told, turns.lost_at) or 0) < 0
        if turns.fitted < OFTEN and (not has_all or lacks_some):
            pass_all_by(talk, response)
        return False
    fit = None if first.asked is None or first.part else visu_body.fit(first.asked, response)
    if fit is False and turns.fitted < OFTEN:
        turns.fitted = 0
        pass_all_by(talk, response)
        return False
    turns.fitted += fit is True
    turns.answer(response, first.message)
    return True


def wait(talk: Talk, one: Waiting) -> None:
    """Have a request wait, if it is known what answers it."""
    early = [response for response in talk.early if response.told is not None]
    if talk.torn and not has_early(talk, one.message):
        talk.torn, talk.turns.doubtful = False, True
    if talk.turns.ask(one.message, early):
        talk.waiting.append(one)
        return
    talk.happened["nobody knows what answers it"] += 1
    talk.turns.owed.requests += len(talk.waiting)
    talk.waiting.clear()
    talk.early.clear()
    talk.torn = False


def may_answer_late(talk: Talk, response: Message, request: Message) -> bool:
    if response.told is not None:
        return may_answer(response, request) or False
    if has(request.told, response.missing_to):
        return False
    lacks_head = request.begin_at is not None and (behind(response.has, request.head_at) or 0) < 0
    return not (lacks_head and (talk.turns.acknowledges or has(request.told, response.behind)))


def has_early(talk: Talk, request: Message) -> bool:
    """Tell whether a request was answered before; what answers none that is still to come is not kept."""
    while talk.early and not may_answer_late(talk, talk.early[0], request):
        talk.early.pop(0)
    return bool(talk.early)


def keep(talk: Talk, response: Message) -> bool:
    """Keep a response that comes while none waits, if it may answer one that has begun, or is still to come."""
    if not talk.early and True in talk.readers and talk.readers[True].begun:
        talk.happened["early response"] += 1
        response.told, response.has = None, response.told
        talk.early.append(response)
        return True
    talk.turns.owed.pass_by(response.behind, response.told)
    if response.told is None:
        return False
    talk.torn = talk.torn or len(talk.early) == MOST_EARLY
    if talk.early and talk.torn:
        note_passed(talk, response)
    else:
        talk.early.append(response)
    return True


def take_early(talk: Talk) -> Message:
    """Return the response that was kept first, and keep it no more."""
    response = talk.early.pop(0)
    if talk.torn and not talk.early:
        talk.torn, talk.turns.doubtful = False, True
    return response
