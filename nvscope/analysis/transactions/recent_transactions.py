"""The last transactions of each pair, and how many requests came in each of the last seconds; an observer."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.analysis.transactions.parameter_transactions import ParameterTransactions
from nvscope.analysis.transactions.transaction import Brought, Group, Outcome, Pair, Room, Transaction
from nvscope.analysis.transactions.visu_transactions import VisuTransactions
from nvscope.engine.told import Told
from nvscope.tracker.pace import Pace, PaceSeen

if TYPE_CHECKING:
    from nvscope.definition.parameters import Parameters

KEPT = 25
"""So many transactions are kept of each pair and group (reads, writes, what went wrong): the last ones."""

MOST_PAIRS = 1_000
"""Of so many pairs they are kept, the first ones; of those behind them nothing but figures is told."""

_ROOM = Room(said=20, characters=120)


class PairSeen(Struct, frozen=True):
    """The last transactions of a pair, the oldest first; a write and what became of it are one.

    ``writes`` is how many writes were asked for, ``per_s`` how many requests came a second of late; None where nobody
    knows.
    """

    transactions: Sequence[Transaction] = ()
    writes: int | None = None
    per_s: float | None = None

    @property
    def last_write(self) -> Transaction | None:
        """The last write that was asked for or answered; None without any."""
        found = (one for one in reversed(self.transactions) if one.writes and one.asked_frame is not None)
        return next(found, None)


NOTHING_SEEN = PairSeen()


class TransactionsSeen(Struct, frozen=True):
    """What is known of pairs at a moment, by their numbers: the last transactions of each, and how many write."""

    numbers: Mapping[Pair, int]
    kept: Sequence[Sequence[Transaction]]
    writes: Sequence[int]
    pace: PaceSeen

    def of(self, pair: Pair, seconds: int = 5) -> PairSeen:
        """Return what is known of a pair; its requests a second are those of the last so many whole seconds."""
        number = self.numbers.get(pair)
        if number is None:
            return NOTHING_SEEN
        return PairSeen(self.kept[number], self.writes[number], self.pace.per_second(number, seconds))

    def __len__(self) -> int:
        return sum(map(len, self.kept))


NO_TRANSACTIONS = TransactionsSeen({}, (), (), Pace().seen())


class _PairLog:
    """The last transactions of one pair."""

    def __init__(self) -> None:
        self._last: tuple[deque[Transaction], ...] = tuple(deque(maxlen=KEPT) for _ in Group)
        self._seen: Sequence[Transaction] | None = None
        self.writes = 0

    def take(self, one: Transaction) -> None:
        self._seen = None
        last = self._last[one.group]
        if one.writes and one.outcome is not Outcome.OPEN and one.asked_frame is not None:
            _forget_asked(last, one.asked_frame)
        last.append(one)

    def seen(self) -> Sequence[Transaction]:
        # Looks share what has not changed between them.
        if self._seen is None:
            self._seen = tuple(sorted(chain(*self._last), key=lambda one: one.known_frame))
        return self._seen


def _forget_asked(last: deque[Transaction], frame: int) -> None:
    """Forget that a write was asked for, since it is known now what became of it."""
    for place in range(len(last) - 1, -1, -1):
        if last[place].outcome is Outcome.OPEN and last[place].asked_frame == frame:
            del last[place]
            return


class RecentTransactions:
    """Keeps the last transactions of each of the first ``MOST_PAIRS`` pairs of each protocol."""

    by_stream: ClassVar[bool] = True

    def __init__(self, parameters: Parameters | None = None) -> None:
        self._sources = ParameterTransactions(parameters, _ROOM), VisuTransactions(_ROOM)
        self._own: list[list[int]] = [[] for _ in self._sources]  # by number of the source's
        self._numbers: dict[Pair, int] = {}
        self._logs: list[_PairLog] = []
        self._pace = Pace()

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        brought = [source.of(told, KEPT) for source in self._sources]
        asked = [self._asked(part, own) for part, own in zip(brought, self._own, strict=True)]
        number, row, writes = (np.concatenate(columns) for columns in zip(*asked, strict=True))
        self._pace.observe_others(told, len(self._logs), number, row)
        for one, count in zip(*np.unique(number[writes], return_counts=True), strict=True):
            self._logs[one].writes += int(count)
        for part in brought:
            for one in part.transactions:
                if one.pair in self._numbers:
                    self._logs[self._numbers[one.pair]].take(one)

    def _asked(self, part: Brought, own: list[int]) -> tuple[I64, I64, Bool]:
        """Return of requests the pairs, the rows, and which of them write; there is a log of each pair then."""
        for pair in part.pairs[len(own) : MOST_PAIRS]:
            own.append(len(self._logs))
            self._numbers[pair] = len(self._logs)
            self._logs.append(_PairLog())
        near = part.pair < len(own)
        return np.array(own, np.int64)[part.pair[near]], part.row[near], part.writes[near]

    def seen(self) -> TransactionsSeen:
        """Return what is known at this moment."""
        kept, writes = tuple(log.seen() for log in self._logs), tuple(log.writes for log in self._logs)
        return TransactionsSeen(dict(self._numbers), kept, writes, self._pace.seen())
