"""What rules about silence watch while captures are read: how long lists are not sent."""

from __future__ import annotations

from bisect import insort
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, Bool
from dissectors.can.pdo import PdoRules
from nvscope.check.asked_rows import EVERY_LIST, AskedRows, OfLists
from nvscope.check.while_so import WhileSo
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.keys import Keys
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.list_key import ListKey

_PACKET_BITS = 40


_MOST_KEPT = 32


class Silence(NamedTuple):
    """A time without a telegram of a list: how long, since when, and a frame.

    That is the one that ended it; of a silence up to the end, the one before it. None where there is none.
    ``is_first``: it was before its first telegram.
    """

    length_ns: int
    begin_ns: int
    frame: int | None
    is_first: bool

    @property
    def end_ns(self) -> int:
        """Up to when it was silent."""
        return self.begin_ns + self.length_ns


class SilenceWatcher:
    """An observer of how long lists are not sent, from ``since_ns`` on; None for the first frame.

    A silence ends where nobody listens any more, or what ``holds`` does not; the next one begins when that is over.
    Of each list the longest ones are kept, of those that are longer than some rule allows.
    """

    by_stream: ClassVar[bool] = True

    def __init__(
        self, since_ns: int | None = None, *, rows: AskedRows | None = None, holds: WhileSo | None = None
    ) -> None:  # fmt: skip
        self._since_ns, self.holds = since_ns, holds
        self._rows = AskedRows({}) if rows is None else rows
        self._keys: list[ListKey] = []
        self._wanted = OfLists()
        self._lists = _SilentColumns()
        self._is_heard = True
        self._least_ns: int | None = None
        self._kept: dict[int, list[Silence]] = defaultdict(list)
        """By list, those that are kept, the longest last."""

        self._before = 0, 0
        """The longest time up to an end of all listening, and since when it was: so long a list was silent at least."""

    def want(self, longer_than_ns: int, lists: OfLists = EVERY_LIST) -> None:
        """Watch some lists, and keep silences that are so long, beside those wanted so far."""
        self._wanted = self._wanted.and_of(lists)
        self._least_ns = longer_than_ns if self._least_ns is None else min(self._least_ns, longer_than_ns)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if len(told):
            self._look_at(told)
        elif self.holds is not None:
            self.holds.see(told)
        for unheard in told.unheard:
            if unheard.everything:
                self._leave_all(unheard.until_ns)
            else:
                self._leave(self._numbers_of(unheard, told.keys, told.pdos), unheard.until_ns)

    def _numbers_of(self, unheard: Unheard, keys: Keys, pdos: PdoRules) -> I64:
        """Return the lists of what nobody listens to any more."""
        channels = {pdos.channel(number) for number in unheard.channels.tolist()}
        of_channels = [number for number, key in enumerate(self._keys) if key.port in channels]
        of_streams = keys.described(unheard.streams)[0] if len(unheard.streams) else np.zeros(0, np.int64)
        found: I64 = np.unique(np.append(of_streams[of_streams < len(self._lists)], of_channels).astype(np.int64))
        return found

    def _leave_all(self, until_ns: int) -> None:
        if self._since_ns is None or not self._is_heard:
            return
        self._leave(np.arange(len(self._lists)), until_ns)
        self._is_heard = False
        self._before = max(self._before, (max(until_ns - self._since_ns, 0), self._since_ns))

    def _leave(self, own: I64, until_ns: int) -> None:
        """End the silences of some lists."""
        known = self._lists
        if self._since_ns is None:
            return
        own = own[~known.paused[own]]
        since_ns = np.where(known.came[own], known.last_ns[own], self._since_ns)
        longer = until_ns - since_ns > known.longest_ns[own]
        row = own[longer]
        known.longest_ns[row], known.begin_ns[row] = until_ns - since_ns[longer], since_ns[longer]
        known.frame[row], known.first[row] = 0, ~known.came[row]
        self._keep(own, until_ns - since_ns, since_ns, np.zeros(len(own), np.int64), ~known.came[own])
        known.paused[own] = True

    def _keep(self, lists: I64, length_ns: I64, begin_ns: I64, frame: I64, is_first: Bool) -> None:
        """Keep those that are among the longest of their lists, of those that are wanted."""
        if self._least_ns is None:
            return
        row = np.flatnonzero((length_ns > self._least_ns) & (length_ns > self._lists.least_ns[lists]))
        columns = lists, length_ns, begin_ns, frame, is_first
        for number, *values in zip(*(one[row].tolist() for one in columns), strict=True):
            kept = self._kept[number]
            insort(kept, Silence(values[0], values[1], values[2] or None, values[3]), key=lambda one: one.length_ns)
            if len(kept) > _MOST_KEPT:
                self._lists.least_ns[number] = kept.pop(0).length_ns

    def _resume(self, at_ns: int) -> None:
        """Let the silences begin that were left."""
        known = self._lists
        self._is_heard, self._since_ns = True, at_ns if self._since_ns is None else max(self._since_ns, at_ns)
        known.last_ns[known.paused], known.paused[:] = self._since_ns, False

    def _look_at(self, told: Told) -> None:
        if self._since_ns is None:
            self._since_ns = told.start_ns
        if not self._is_heard and self.holds is None:
            self._resume(int(told.packets.ts_ns.min()))
        keys = told.keys
        before = len(self._lists)
        self._lists.resize(len(keys.lists))
        longest_ns, begin_ns = self._before
        self._lists.longest_ns[before:], self._lists.begin_ns[before:] = longest_ns, begin_ns
        self._keys += [keys.list_key(number) for number in range(len(self._keys), len(keys.lists))]
        latest_ns = self._rows.latest_ns(told)
        if self.holds is None:
            for lists, packet in self._columns(told):
                self._take(lists, packet, latest_ns, told.first_frame)
            return
        columns = [_by_packet(*one) for one in self._columns(told)]
        for start, stop, is_so in self.holds.see(told).stretches():
            if not is_so:
                self._leave_all(int(latest_ns[start]))
                continue
            if not self._is_heard:
                self._resume(int(latest_ns[start]))
            for lists, packet in columns:
                part = slice(*np.searchsorted(packet, [start, stop]).tolist())
                self._take(lists[part], packet[part], latest_ns, told.first_frame)

    def _columns(self, told: Told) -> Iterator[tuple[I64, I64]]:
        """Yield the lists of telegrams, and their packets; of frames of CAN likewise."""
        for runs, own in self._rows.runs(told, self._wanted):
            rows, run = runs.rows, np.array(own)
            packet = rows.packet if len(run) == len(runs.lists) else rows.packet[rows.of_runs(run)]
            yield np.repeat(runs.lists[run], (rows.stop - rows.start)[run]), packet

    def _take(self, lists: I64, packet: I64, latest_ns: I64, first_frame: int) -> None:
        if not len(lists):
            return
        assert self._since_ns is not None
        known = self._lists
        # What comes by stream is in order already, but for lists of several: a sort that merges has little to do.
        order = np.argsort(lists << _PACKET_BITS | packet, kind="stable")
        lists, packet = lists[order], packet[order]
        behind_ns = np.maximum(latest_ns[packet], self._since_ns)
        begin = np.flatnonzero(np.diff(lists, prepend=-1))
        own = lists[begin]
        before_ns = np.append(self._since_ns, behind_ns[:-1])
        before_ns[begin] = np.where(known.came[own], known.last_ns[own], self._since_ns)
        before_ns[begin] = np.where(known.paused[own], behind_ns[begin], before_ns[begin])
        known.paused[own] = False
        gap_ns = behind_ns - before_ns
        longest_ns = np.maximum.reduceat(gap_ns, begin)
        stop = np.append(begin[1:], len(lists))
        for place in np.flatnonzero(longest_ns > known.longest_ns[own]).tolist():
            number, first = int(own[place]), int(begin[place])
            row = first + int(gap_ns[first : stop[place]].argmax())
            known.longest_ns[number], known.begin_ns[number] = longest_ns[place], before_ns[row]
            known.frame[number] = packet[row] + first_frame
            known.first[number] = not known.came[number] and row == first
        is_first = np.zeros(len(lists), np.bool_)
        is_first[begin] = ~known.came[own]
        self._keep(lists, gap_ns, before_ns, packet + first_frame, is_first)
        known.last_ns[own] = behind_ns[stop - 1]
        known.last_frame[own] = packet[stop - 1] + first_frame
        known.came[own] = True

    def nothing(self, until_ns: int) -> tuple[int, int]:
        """Return how long a list was silent at least that never came, up to a time, and since when that was."""
        since_ns = until_ns if self._since_ns is None else self._since_ns
        return max(self._before, (until_ns - since_ns, since_ns)) if self._is_heard else self._before

    def of(self, lists: Collection[ListKey], until_ns: int) -> Mapping[ListKey, Sequence[Silence]]:
        """Return silences of each of some lists that were ever sent, up to a time, the longest first.

        That one is always there, the others are those that are kept.
        """
        numbers = {key: number for number, key in enumerate(self._keys)}
        found, known = {}, self._lists
        for key in sorted(lists):
            number = numbers.get(key)
            if number is None or not known.came[number]:
                continue
            last_ns, longest_ns = int(known.last_ns[number]), int(known.longest_ns[number])
            frame = int(known.frame[number]) or None
            own = {Silence(longest_ns, int(known.begin_ns[number]), frame, bool(known.first[number]))}
            if not known.paused[number]:
                own.add(Silence(until_ns - last_ns, last_ns, int(known.last_frame[number]) or None, is_first=False))
            own.update(self._kept.get(number, ()))
            found[key] = sorted(own, key=lambda one: (-one.length_ns, one.begin_ns))
        return found


def _by_packet(lists: I64, packet: I64) -> tuple[I64, I64]:
    order = np.argsort(packet, kind="stable")
    return lists[order], packet[order]


class _SilentColumns(KeyedColumns):
    """One row a list: whether it came, when last, whether nobody listens to it.

    Of its longest silence: how long it was, when it began, the frame that ended it, 0 for none, and whether it was
    before its first telegram. What is not longer than ``least_ns`` is not among those that are kept.
    """

    came: Bool
    paused: Bool
    first: Bool
    last_ns: I64
    longest_ns: I64
    begin_ns: I64
    frame: I64
    last_frame: I64
    least_ns: I64
    COLUMNS: ClassVar = {
        "came": (np.False_, 1),
        "paused": (np.False_, 1),
        "first": (np.True_, 1),
        "last_ns": (np.int64(0), 1),
        "longest_ns": (np.int64(0), 1),
        "begin_ns": (np.int64(0), 1),
        "frame": (np.int64(0), 1),
        "last_frame": (np.int64(0), 1),
        "least_ns": (np.int64(0), 1),
    }
