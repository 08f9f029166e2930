"""Player: where a capture that is played is, how fast it goes on, and where somebody wants it to be."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from msgspec import Struct

LEAST_RATE, MOST_RATE = 0.1, 100.0
"""Slower, nothing seems to happen; faster, nothing can be seen of what happens."""

_TICK_S, _SHORTEST_S = 0.05, 0.0001
_GAP_NS = 1_000_000_000
"""A pause that is skipped lasts so long."""
_MOST_BEHIND_S, _BEHIND_FOR_S = 0.5, 2.0
_LEAST_ROUND_S = 1.0
"""What is repeated takes so long at least, or nobody could see it: what is left of that, it stands at the end."""


class Turn(Struct, frozen=True):
    """What may pass now: packets up to a time, ``most`` of them; without any, the time up to which nothing comes."""

    through_ns: int
    most: int | None = None


class Place(Struct, frozen=True):
    """Where a capture is: the time up to which it was told, None before its first packet, and how many packets were.

    ``rate`` is how many times as fast as it was it goes on; ``paused``, it stands. ``is_going``: it is on its way to
    where somebody wants it. ``is_behind``: it goes on slower than it should, as fast as this machine can.
    ``at_end``: nothing follows. Between ``a_ns`` and ``b_ns`` it is repeated, or with ``loops`` as a whole.
    """

    at_ns: int | None
    frames: int
    rate: float
    paused: bool
    is_going: bool
    is_behind: bool
    at_end: bool
    a_ns: int | None
    b_ns: int | None
    loops: bool


class Player:
    """Says what of a capture may pass when, by one clock, and takes what people want of it; for any thread.

    Going back needs the capture from its beginning again: then ``turns`` is another number, and what was iterated for
    the one before ends (``Played``). With ``skips_gaps`` a pause of more than a second lasts one. ``clock`` tells
    seconds, and ``sleep`` lets them pass, unless something changes.
    """

    def __init__(
        self, rate: float = 1.0, *, skips_gaps: bool = False, loops: bool = False,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[threading.Condition, float], object] = threading.Condition.wait,
    ) -> None:  # fmt: skip
        self._clock, self._sleep, self._skips = clock, sleep, skips_gaps
        self._changed = threading.Condition()
        self._rate, self._loops, self._paused = rate, loops, False
        self._a_ns: int | None = None
        self._b_ns: int | None = None
        self._turns = self._changes = 0
        self._stopped = self._at_end = False
        self._behind_s: float | None = None  # when it was behind the last time
        self._round_s: float | None = None  # since when it goes on from the beginning of what is repeated
        self._at_ns: int | None = None
        self._frames = 0
        self._last_ns: int | None = None  # the time of the last packet
        self._goal_ns: int | None = None
        self._goal_frames: int | None = None
        # At the one time the capture was, or is to be, at the other.
        self._since_s: float | None = None
        self._since_ns = 0

    @property
    def place(self) -> Place:
        """Where the capture is."""
        with self._changed:
            return Place(
                self._at_ns, self._frames, self._rate, self._paused, self._is_going, self._lags, self._at_end,
                self._a_ns, self._b_ns, self._loops,
            )  # fmt: skip

    @property
    def turns(self) -> int:
        """How often the capture was begun again."""
        return self._turns

    @property
    def _is_going(self) -> bool:
        return self._goal_ns is not None or self._goal_frames is not None

    @property
    def changes(self) -> int:
        """How often somebody wanted something else so far, or it came to where somebody wanted it."""
        return self._changes

    @property
    def _lags(self) -> bool:
        return self._behind_s is not None and self._clock() - self._behind_s < _BEHIND_FOR_S

    def wait_for_change(self, changes: int, timeout_s: float) -> None:
        """Wait until there were more changes than so many."""
        with self._changed:
            self._changed.wait_for(lambda: self._changes > changes, timeout_s)

    # What people want.

    def pause(self, paused: bool) -> None:
        """Let it stand, or go on; at the end, going on begins anew."""
        with self._changed:
            self._paused = paused
            if not paused and self._at_end:
                self._go(self._first_ns)
            self._tell()

    def set_rate(self, rate: float) -> None:
        """Let it go on so many times as fast as it was."""
        with self._changed:
            self._rate = min(max(rate, LEAST_RATE), MOST_RATE)
            self._tell()

    def loop(self, loops: bool) -> None:
        """Begin again at the end, or not."""
        with self._changed:
            self._loops = loops
            if loops and self._at_end:
                self._go(self._first_ns)
            self._tell()

    def repeat(self, a_ns: int | None, b_ns: int | None) -> None:
        """Repeat what is between two moments; None for what is not known yet, or no more wanted."""
        with self._changed:
            self._a_ns, self._b_ns = a_ns, b_ns
            if a_ns is not None and b_ns is not None and (self._at_ns or a_ns) >= b_ns:
                self._go(a_ns)
            self._tell()

    def go(self, time_ns: int) -> None:
        """Be at a moment: what is before it has passed, and it stands or goes on from there as before."""
        with self._changed:
            self._go(time_ns)
            self._tell()

    def step(self, frames: int) -> None:
        """Stand so many packets further on, or, where that is below 0, back; at the first one it stays."""
        with self._changed:
            self._paused = True
            goal = max((self._frames if self._goal_frames is None else self._goal_frames) + frames, 1)
            if frames < 0 and goal < self._frames:
                self._begin_again()
            if goal > self._frames and not self._at_end:
                self._goal_ns, self._goal_frames = None, goal
            self._tell()

    def stop(self) -> None:
        """Let nothing pass any more."""
        with self._changed:
            self._stopped = True
            self._tell()

    @property
    def _first_ns(self) -> int | None:
        return self._a_ns if self._b_ns is not None else None

    def _go(self, time_ns: int | None) -> None:
        """Be at a moment, None for the beginning."""
        if time_ns is None or (self._at_ns is not None and time_ns < self._at_ns):
            self._begin_again()
        self._goal_ns, self._goal_frames = None if self._at_end else time_ns, None

    def _begin_again(self) -> None:
        self._turns += 1
        self._round_s = None
        self._at_ns = self._last_ns = None
        self._frames = 0
        self._goal_ns = self._goal_frames = None
        self._at_end = False

    def _tell(self) -> None:
        """Tell all who wait that something has changed; time counts from where it is."""
        self._since_s = None
        self._changes += 1
        self._changed.notify_all()

    # What passes.

    def turn(self, turns: int, next_ns: int) -> Turn | None:
        """Wait until something may pass, or time has; None where what is iterated for ``turns`` is to end.

        ``next_ns`` is the time of the packet that comes next, or of an earlier one that is later.
        """
        with self._changed:
            while not self._stopped and turns == self._turns:
                if self._is_going:
                    turn = self._towards_goal(next_ns)
                elif self._paused:
                    self._changed.wait()
                    continue
                else:
                    turn = self._by_clock(next_ns)
                if turn is not None:
                    return turn
            return None

    def _towards_goal(self, next_ns: int) -> Turn | None:
        if self._goal_frames is not None:
            if (left := self._goal_frames - self._frames) > 0:
                return Turn(next_ns, left) if self._goal_ns is None else None
        elif self._goal_ns is not None:
            if next_ns <= self._goal_ns:
                return Turn(self._goal_ns)
            if self._at_ns is not None and self._at_ns < self._goal_ns:
                return Turn(self._goal_ns)
        self._goal_ns = self._goal_frames = None
        self._tell()
        return None

    def _by_clock(self, next_ns: int) -> Turn | None:
        now_s = self._clock()
        if self._at_ns is None:
            self._at_ns = next_ns
        self._round_s = now_s if self._round_s is None else self._round_s
        if self._since_s is None:
            self._since_s, self._since_ns = now_s, self._at_ns
        now_ns = self._since_ns + int((now_s - self._since_s) * 1e9 * self._rate)
        if (now_ns - self._at_ns) / 1e9 / self._rate > _MOST_BEHIND_S:
            # What is behind stays behind: nobody wants to be shown in a rush what a slow moment kept back.
            self._since_s, self._since_ns = now_s, self._at_ns + int(_TICK_S * 1e9 * self._rate)
            now_ns, self._behind_s = self._since_ns, now_s
        if self._b_ns is not None and self._a_ns is not None and now_ns >= self._b_ns:
            if self._at_ns >= self._b_ns:
                self._begin_round()
                return None
            return Turn(self._b_ns)
        if next_ns <= now_ns:
            return Turn(now_ns)
        if self._skips and self._last_ns is not None and next_ns - self._last_ns > _GAP_NS:
            passed_ns = now_ns - self._last_ns
            if passed_ns >= _GAP_NS:
                self._since_s, self._since_ns = now_s, next_ns
                return Turn(next_ns)
        left_s = (next_ns - now_ns) / 1e9 / self._rate
        passed_s = (now_ns - self._at_ns) / 1e9 / self._rate
        if passed_s >= _TICK_S:
            return Turn(now_ns)
        self._sleep(self._changed, max(min(left_s, _TICK_S - passed_s), _SHORTEST_S))
        return None

    def has_passed(self, turns: int, frames: int, last_ns: int | None, at_ns: int) -> None:
        """Take that so many packets were told, the latest time of them, and up to which time nothing else comes."""
        with self._changed:
            if turns == self._turns:
                self._frames += frames
                self._last_ns = self._last_ns if last_ns is None else last_ns
                self._at_ns = at_ns if self._at_ns is None else max(at_ns, self._at_ns)

    def has_ended(self, turns: int) -> None:
        """Take that no packet follows."""
        with self._changed:
            if turns != self._turns or self._stopped:
                return
            self._goal_ns = self._goal_frames = None
            changes = self._changes
            while self._is_repeated and turns == self._turns and changes == self._changes and not self._stopped:
                self._begin_round()
            if turns == self._turns:
                self._at_end = True
                self._tell()

    @property
    def _is_repeated(self) -> bool:
        return (self._loops or self._b_ns is not None) and bool(self._frames) and not self._paused

    def _begin_round(self) -> None:
        """Begin again with what is repeated; or wait a while, where it has only just begun."""
        now_s = self._clock()
        left_s = 0.0 if self._round_s is None else self._round_s + _LEAST_ROUND_S - now_s
        if left_s > 0:
            self._sleep(self._changed, min(left_s, _LEAST_ROUND_S))
        else:
            self._go(self._first_ns)
            self._tell()
