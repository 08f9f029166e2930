"""Pace: how many telegrams of each list came in each of the last seconds."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told

PACE_SECONDS = 180
MOST_LISTS = 5_000
"""Of so many lists it is kept, of those behind them it is unknown: it is looked at, and no figure."""

_S_NS = 1_000_000_000
_NEVER = np.iinfo(np.int64).max
Counts = npt.NDArray[np.int32]


class PaceSeen(Struct, frozen=True):
    """How many well-formed data telegrams, and data frames of CAN, came in each second up to a moment.

    ``counts`` has a row a second, the oldest first, and a column a list by its number: int32 of shape
    (``PACE_SECONDS``, lists). The last row is second ``last_s`` since 1970, which is not over yet at ``until_ns``; in
    front of ``first_s`` nothing was observed, from ``whole_s`` on whole seconds were. ``began_ns`` and ``last_ns`` are
    when the first and the last telegram of each list came, 0 without any.
    """

    counts: Counts
    began_ns: npt.NDArray[np.int64]
    last_ns: npt.NDArray[np.int64]
    first_s: int = 0
    last_s: int = 0
    until_ns: int = 0
    whole_s: int = 0

    def per_second(self, number: int, seconds: int = 5) -> float | None:
        """Return how many came of a list a second, over the last whole seconds; None where nobody knows.

        The second in which a list began is no whole one of it, and none before that is.
        """
        if number >= self.counts.shape[1]:
            return None
        began_ns = int(self.began_ns[number])
        # One that lies ahead is of before the clock was set back.
        began_s = -(-began_ns // _S_NS) if began_ns <= self.until_ns else 0
        known = min(seconds, self.last_s - max(self.first_s, self.whole_s, began_s))
        if known <= 0:
            return None
        return float(self.counts[-1 - known : -1, number].sum()) / known

    def of_all(self, seconds: int = 5) -> float | None:
        """Return how many came a second of all lists; None where nobody knows."""
        known = min(seconds, self.last_s - max(self.first_s, self.whole_s))
        return float(self.counts[-1 - known : -1].sum()) / known if known > 0 else None

    def last_of(self, number: int) -> int | None:
        """Return when the last telegram of a list came, None where none did, or nobody knows."""
        return int(self.last_ns[number]) or None if number < len(self.last_ns) else None

    def seconds(self, number: int, count: int) -> list[int]:
        """Return how many came of a list in each of the last ``count`` whole seconds, the oldest first."""
        if number >= self.counts.shape[1]:
            return []
        known = max(min(count, self.last_s - self.first_s, PACE_SECONDS - 1), 0)
        seen: list[int] = self.counts[PACE_SECONDS - 1 - known : PACE_SECONDS - 1, number].tolist()
        return seen


class Pace:
    """Counts telegrams by second and list, for the last ``PACE_SECONDS``; an observer.

    Where the clock goes back further than that, it begins anew.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self) -> None:
        # By second modulo PACE_SECONDS.
        self._counts: Counts = np.zeros((PACE_SECONDS, 0), np.int32)
        self._began_ns = np.zeros(0, np.int64)
        self._last_ns = np.zeros(0, np.int64)
        self._first_s = self._last_s = self._whole_s = 0
        self._until_ns = 0
        self._begun = False

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told):
            first = self._begin(told, len(told.keys.lists))
            for rows in (told.laid.data, told.laid.pdos):
                if len(rows):
                    self._count(rows, told, first)
        if told.until_ns is not None:
            self._move(told.until_ns, told.until_ns)

    def observe_others(self, told: Told, wide: int, number: I64, packet: I64) -> None:
        """Take a batch of which something else than lists is counted: so many things, by number, in these packets."""
        if len(told):
            first = self._begin(told, wide)
            near = number < MOST_LISTS
            number, packet = number[near], packet[near]
            time_ns = told.packets.ts_ns[packet]
            np.maximum.at(self._last_ns, number, time_ns)
            self._note_began(number[self._began_ns[number] == 0], time_ns[self._began_ns[number] == 0])
            self._add(number, time_ns, packet, first)
        if told.until_ns is not None:
            self._move(told.until_ns, told.until_ns)

    def _begin(self, told: Told, wide: int) -> int:
        """Let time pass up to the end of a batch, and have so many columns; return from which packet on it counts."""
        first = self._begun_anew(told)
        ts_ns = told.packets.ts_ns[first:]
        self._move(int(ts_ns[0]), int(ts_ns.max()))
        more = min(wide, MOST_LISTS) - self._counts.shape[1]
        if more > 0:
            self._counts = np.pad(self._counts, ((0, 0), (0, more)))
            self._began_ns = np.pad(self._began_ns, (0, more))
            self._last_ns = np.pad(self._last_ns, (0, more))
        return first

    def _note_began(self, number: I64, time_ns: I64) -> None:
        """Take when what had not begun yet did."""
        if len(number):
            began_ns = np.full(len(self._began_ns), _NEVER)
            np.minimum.at(began_ns, number, time_ns)
            self._began_ns = np.where(began_ns < _NEVER, began_ns, self._began_ns)

    def _begun_anew(self, told: Told) -> int:
        """Return from which packet on a batch counts: the first one behind a clock that went far back."""
        if told.clock.steady:
            return 0
        back = np.flatnonzero(told.clock.step_ns < -PACE_SECONDS * _S_NS)
        return int(back[-1]) + 1 if len(back) else 0

    def _count(self, rows: DataRows, told: Told, first: int) -> None:
        """Count the telegrams that lie in packets from ``first`` on."""
        keys = told.keys
        own = keys.list_of_place(keys.place_of(rows.run_stream))
        near = own < MOST_LISTS
        np.maximum.at(self._last_ns, own[near], rows.time_ns[rows.stop - 1][near])
        new = near & (self._began_ns[np.minimum(own, len(self._began_ns) - 1)] == 0)
        self._note_began(own[new], rows.time_ns[rows.start][new])
        self._add(np.repeat(own, rows.stop - rows.start), rows.time_ns, rows.packet, first)

    def _add(self, lists: I64, time_ns: I64, packet: I64, first: int) -> None:
        second = time_ns // _S_NS
        kept = (lists < MOST_LISTS) & (second > self._last_s - PACE_SECONDS) & (packet >= first)
        if not kept.all():
            lists, second = lists[kept], second[kept]
        wide = self._counts.shape[1]
        place = second % PACE_SECONDS * wide + lists
        self._counts += np.bincount(place, minlength=PACE_SECONDS * wide).reshape(PACE_SECONDS, wide).astype(np.int32)

    def _move(self, first_ns: int, last_ns: int) -> None:
        """Let time pass: seconds that were not there yet have nothing in them."""
        last_s = last_ns // _S_NS
        if not self._begun or last_s < self._last_s - PACE_SECONDS:
            self._begun = True
            self._counts[:] = 0
            self._began_ns[:] = self._last_ns[:] = 0
            self._first_s, self._last_s = first_ns // _S_NS, last_s
            self._whole_s = -(-first_ns // _S_NS)
            self._until_ns = last_ns
            return
        self._until_ns = max(self._until_ns, last_ns)
        if last_s > self._last_s:
            new = np.arange(max(self._last_s + 1, last_s - PACE_SECONDS + 1), last_s + 1) % PACE_SECONDS
            self._counts[new] = 0
            self._last_s = last_s
            self._first_s = max(self._first_s, last_s - PACE_SECONDS + 1)

    def seen(self) -> PaceSeen:
        """Return what is known at this moment."""
        order = np.arange(self._last_s - PACE_SECONDS + 1, self._last_s + 1) % PACE_SECONDS
        return PaceSeen(
            self._counts[order],
            self._began_ns.copy(),
            self._last_ns.copy(),
            self._first_s,
            self._last_s,
            self._until_ns,
            self._whole_s,
        )
