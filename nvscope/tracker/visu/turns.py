"""Turns: whether it is sure, behind bytes that were not captured, that all requests in front of one were answered.

A client takes turns: it sends a request, or several at once, waits until all of them are answered, and sends more. With
a request of a new turn, it acknowledges more of the server's bytes than with the one before. Behind missing bytes, the
first request of a new turn is in step again; in front of one of the same turn there may be others, which nobody saw,
and whose replies come first. What the server sent without all that is missing of the client does not show that this was
answered; what it sent with all of that shows that a later turn begins. Of a client that was seen to send more while
replies were still to come, nobody knows; nor while it is owed replies to requests that were seen (``owed_replies``). Of
one that was seen to send several at once, the first of a turn may be missing, where no reply is there that shows the
turn: so the next turn is. A reply that cannot be the one to what it would answer shows that all of this was wrong,
unless several have fitted since.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import I64
from nvscope.tracker.segments import HALF, WRAP
from nvscope.tracker.segments_aside import NEAR
from nvscope.tracker.visu.awaited import Waiting
from nvscope.tracker.visu.owed_replies import OwedReplies
from nvscope.tracker.visu.reach import UNKNOWN, Reach, distance, distances, is_had, latest, latest_of

_OFTEN = 3
"""Who has waited so many times for all replies to several requests takes turns."""

_TRIED = 3
"""Behind missing bytes, it is believed after so many replies that they are those to what they are paired with."""


class Turns(Struct):
    """Those of a connection.

    ``had`` is up to where the client had the server's bytes with its last request, ``answered`` where the last response
    ends that answered one, or where the server begins. ``pair`` is the same of the last request that was answered, and
    of the response. ``is_doubtful``: nobody knows which response comes next; ``overlap``: the client was seen not to
    take turns. ``asked`` is what the client had with its last request, ``several``: it was seen to send several at
    once; ``lost``: bytes of it are missing behind its last request. ``lost_at`` is where those end, ``missing_at``
    where the last ones of the server do with which that lost step. ``has_rest``: behind what is missing, a request of
    the client ends in front of the first one that is known. ``is_guess``: what was asked last is in step if it
    was asked alone: nothing behind it has told that yet. ``began`` is where the client begins, ``told`` how far its
    server had its bytes where that does. ``waited`` is how often it waited for all replies to several requests, which
    the last one that was answered is one of, if ``of_several``. ``starts`` is where the server begins, until its client
    has asked with all that is in front of that. ``fitted`` is how many replies since bytes were missing could be those
    to what they are paired with, as far as that matters. ``acknowledges``: the server was seen to acknowledge what it
    answers, so that its acknowledgements tell what it does not answer.
    """

    had: int = UNKNOWN
    answered: int = UNKNOWN
    pair: tuple[int, int] = (UNKNOWN, UNKNOWN)
    is_doubtful: bool = False
    overlap: bool = False
    asked: int = UNKNOWN
    several: bool = False
    lost: bool = False
    lost_at: int = UNKNOWN
    missing_at: int = UNKNOWN
    has_rest: bool = False
    is_guess: bool = False
    began: int = UNKNOWN
    told: int = UNKNOWN
    waited: int = 0
    of_several: bool = False
    starts: int = UNKNOWN
    fitted: int = _TRIED
    acknowledges: bool = False
    owed: OwedReplies = field(default_factory=OwedReplies)

    def begin(self, *, began: int = UNKNOWN, told: int = UNKNOWN) -> bool:
        """Take where one of both directions begins; return whether bytes of the client are missing in front of it."""
        self.began, self.told = latest([self.began, began]), latest([self.told, told])
        lacks = 0 < distance(self.began, self.told) <= NEAR
        if lacks:
            self.lose_client(self.began)
            self.lost = self.asked == UNKNOWN
        return lacks

    @property
    def is_unsure(self) -> bool:
        """Whether what comes next matters to what answers the requests that wait, or are still to come."""
        return self.is_doubtful or self.is_guess or self.starts != UNKNOWN or self.is_tried

    @property
    def is_tried(self) -> bool:
        """Whether a reply that cannot be the one to what it is paired with shows that it answers something else."""
        return self.fitted < _TRIED

    def refutes(self, may_be: bool | None) -> bool:
        """Take whether a reply may be the one to what it is paired with, None where nobody knows; return if it is not.

        That of a controller that counts wrong is, where nothing is missing.
        """
        if may_be is False and self.is_tried:
            self.fitted = 0
            return True
        self.fitted += may_be is True
        return False

    def begin_server(self, begin: int) -> None:
        """Take where the server begins."""
        self.answered = self.starts = begin
        self._pass_start(self.had)

    def _pass_start(self, had: int) -> None:
        """Take that the client has so much: whether that is all in front of where the server begins."""
        if is_had(self.starts, had):
            self.starts = UNKNOWN

    def lose(self) -> None:
        """Take that bytes of the server are missing, and with them replies, so many that nobody knows."""
        self.is_doubtful = True

    def miss_server(self, behind: int, waited: int | None) -> None:
        """Take that bytes of the server are missing up to there; so many ``waited``, None where it is known for what.

        ``lose`` tells the rest.
        """
        self.missing_at, self.fitted = behind, 0
        if waited is not None:
            self.owed.wait(waited)
            self.owed.lose(behind)

    def lose_client(self, behind: int, waited: int = 0) -> None:
        """Take that bytes of the client are missing up to there, and with them requests, so many that nobody knows.

        So many ``waited`` then.
        """
        self.owed.wait(waited + (not self.lost))
        self.is_doubtful = self.lost = True
        self.lost_at, self.has_rest, self.fitted = behind, False, 0

    def pass_rest(self, begin: int) -> None:
        """Take that a request comes that begins there."""
        if self.lost and distance(begin, self.lost_at) > 0:
            self.lost_at, self.has_rest = begin, True

    def pass_by(self, begin: int) -> None:
        """Take that a response begins there that may answer a request whose client had none of it."""
        if begin != UNKNOWN:
            self.missing_at = latest([self.missing_at, (begin + 1) % WRAP])

    def miss(self, had: int) -> None:
        """Take that the client had so much in front of what is missing of it."""
        self.had = latest([self.had, had])
        self._pass_start(had)

    def ask(self, reach: Reach, others: Iterable[Reach] = ()) -> bool:
        """Take a request; return whether the next response that comes is known to be its own, but for what waits.

        ``others`` are responses in front of it that answered nothing.
        """
        had, lost, self.lost = reach.acknowledged, self.lost, False
        was_guess, self.is_guess = self.is_guess, False
        if had == UNKNOWN:
            self.is_doubtful = False
            return True
        is_same_turn = had == self.asked
        self.several |= is_same_turn
        self.is_doubtful |= was_guess and is_same_turn
        self._pass_start(had)
        # What answers it may be among what the server sent in front of where it begins.
        self.is_doubtful |= distance(self.starts, had) > 0
        if self.is_doubtful:
            others = list(others)
            without = (one.behind for one in others if distance(one.acknowledged, self.lost_at) < 0)
            known = latest([self.had, self.answered, *without])
            may_lack = lost and not any(self._shows_turn(one, had) for one in others)
            hides_several = lost and self.owed.show_several(had)
            # Who asks again with what it had in front of what is missing has not waited for the reply to that.
            self.several |= hides_several or (lost and had == latest([self.had, self.answered]))
            one_each = self.several and self.waited < _OFTEN
            left = self.owed.left(had, self.answered, one_each=one_each)
            is_unsure = (
                self.overlap
                or left > 0
                or hides_several
                or (may_lack and (self.several or self.has_rest))
                or distance(had, self.missing_at) < 0
            )
            self.is_doubtful = known != UNKNOWN and (is_unsure or distance(had, known) <= 0)
            self.is_guess = may_lack and not self.is_doubtful
            if self.is_doubtful:
                self.owed.wait(1)
            else:
                self.owed.settle(had)
        self.asked, self.had = had, latest([self.had, had])
        return not self.is_doubtful

    def _shows_turn(self, response: Reach, had: int) -> bool:
        """Tell whether a response shows that what a client asks begins another turn than what is missing of it."""
        if UNKNOWN in (self.lost_at, response.acknowledged, response.behind):
            return False
        return distance(response.acknowledged, self.lost_at) >= 0 and distance(response.behind, had) <= 0

    def may_answer(self, first: Waiting, reach: Reach) -> bool:
        """Tell whether a response may answer the first request that waits."""
        told, body_at = reach.acknowledged, first.reach.body_at
        lacks_head = distance(told, body_at) < 0
        # If acknowledgements are real.
        if first.had(reach) and (first.is_behind or lacks_head or self.acknowledges):
            return False
        if UNKNOWN in (told, body_at):
            return True
        self.acknowledges |= not lacks_head
        return not (lacks_head and self.acknowledges)

    def shows_more(self, first: Waiting, reach: Reach) -> bool:
        """Tell whether a response that does not answer the first request that waits shows that others are in front.

        It answers one of these if the client did not have it when it asked; if it did, it had no more than that, and
        asked for something else that is missing with it, which the server had not.
        """
        if not first.had(reach):
            return True
        had, told = first.reach.acknowledged, reach.acknowledged
        return UNKNOWN not in (told, self.lost_at) and had == reach.behind and distance(told, self.lost_at) < 0

    def answer(self, had: int, behind: int) -> None:
        """Take that a request was answered with which the client had so much, by a response that ends there."""
        before, end = self.pair
        self.is_guess = False
        self.overlap |= distance(had, before) > 0 and distance(end, had) > 0
        self.owed.forget(behind)
        self.waited += self.of_several and had == end
        self.of_several = had == before != UNKNOWN
        self.pair, self.answered = (had, behind), latest([self.answered, behind])

    def _overlaps(self, had: I64, behind: I64) -> bool:
        """Tell whether a client asked one of several before it had all of what answered the one before, but more."""
        before, end = np.empty_like(had), np.empty_like(behind)
        (before[0], end[0]), before[1:], end[1:] = self.pair, had[:-1], behind[:-1]
        ahead = end - had
        if int(ahead.max()) <= 0 and int(ahead.min()) >= -HALF:
            return False  # each had all of it, as nearly all have
        late = distances(end, had) > 0
        return bool(late.any() and (late & (distances(had, before) > 0)).any())

    def _note_waiting(self, had: I64, behind: I64) -> None:
        """Note how often a client waited for all replies to several requests that it sent at once."""
        before, end = self.pair
        first = int(had[0])
        if first != before and not (had[1:] == had[:-1]).any():
            self.waited += self.of_several and first == end
            self.of_several = False
            return
        same = np.append(first == before, had[1:] == had[:-1]) & (had != UNKNOWN)
        follows = np.append(first == end, had[1:] == behind[:-1])
        self.waited += int((follows & np.append(self.of_several, same[:-1])).sum())
        self.of_several = bool(same[-1])

    def copy(self) -> Turns:
        """Return another one that is as this one is."""
        return replace(self, owed=self.owed.copy())

    def answer_all(self, had: I64, behind: I64, first: int, *, in_step: bool = False) -> None:
        """Take that requests were answered in their order; ``behind`` is where what answers the first of them ends.

        ``had`` is what the client had with each; those from the place ``first`` on are new. ``in_step``: they are
        known to be (``are_in_step``). None of them is in doubt.
        """
        asked, replies = had[first:], len(behind)
        if in_step and len(asked) and self._answer_in_step(had, behind, asked):
            return
        if replies:
            answered = had[:replies]
            self._note_waiting(answered, behind)
            self.overlap = self.overlap or self._overlaps(answered, behind)
            self.pair = int(answered[-1]), int(behind[-1])
            self.answered = latest_of(self.answered, behind)
        known = asked[asked != UNKNOWN]
        if len(known):
            self.several = self.several or self.asked == known[0] or bool((known[1:] == known[:-1]).any())
            self.asked, self.lost = int(known[-1]), False
        self.had = latest_of(self.had, asked)

    def _answer_in_step(self, had: I64, behind: I64, asked: I64) -> bool:
        """Take the same of what is in step; return False, having done nothing, where it does not follow what was."""
        before, end = self.pair
        first, last, begin, latest_had = int(had[0]), int(behind[-1]), int(asked[0]), int(asked[-1])
        known = end, self.answered, self.had
        if first == before or UNKNOWN in known or max(known) > first or last - min(known) >= HALF:
            return False
        self.waited += self.of_several and first == end
        self.of_several = False
        self.pair, self.answered = (int(had[len(behind) - 1]), last), last
        self.several = self.several or self.asked == begin
        self.asked, self.lost, self.had = latest_had, False, latest_had
        return True
