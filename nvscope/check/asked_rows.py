"""Telegrams that rules look at one by one: those of the lists that a rule asks for, made once for all rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from msgspec import Struct, field

from dissectors.batch import I64, Bool
from nvscope.check.lists import names_of
from nvscope.engine.keys import Keys
from nvscope.engine.rows import DataRows
from nvscope.engine.telegram_streams import TelegramStreams
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.name_patterns import fits, is_pattern
from nvscope.view.rows.frames import FrameRows

_NO_LIST = -1


class OfLists(Struct, frozen=True):
    """Some lists: those with one of the ``keys``, and those that one of the ``patterns`` fits."""

    keys: frozenset[ListKey] = frozenset()
    patterns: tuple[str, ...] = ()

    def and_of(self, others: OfLists) -> OfLists:
        """Return these lists and others."""
        return OfLists(self.keys | others.keys, tuple(dict.fromkeys((*self.patterns, *others.patterns))))

    def among(self, keys: Sequence[ListKey], names: Mapping[ListKey, str]) -> Sequence[bool]:
        """Tell which of some lists are of them; ``names`` are what definitions call them."""
        whole = {one.lower() for one in self.patterns if not is_pattern(one)}
        patterns = [one for one in self.patterns if is_pattern(one)]
        if "*" in patterns:
            return [True] * len(keys)
        if not patterns and not self.keys:
            return [not whole.isdisjoint(names_of(key, names)) for key in keys]
        return [
            key in self.keys
            or key.on_any_channel in self.keys
            or not whole.isdisjoint(called := names_of(key, names))
            or any(fits(pattern, name) for pattern in patterns for name in called)
            for key in keys
        ]


EVERY_LIST = OfLists(patterns=("*",))


class Asked(Struct, frozen=True):
    """Telegrams of one batch, in the order in which they came.

    ``stream`` are the numbers of their streams, ``list`` those of their lists, -1 of what is of none. ``time_ns`` is
    when each came, or the latest time before that: clocks that step back do not turn the order around. ``frame`` are
    their numbers in the capture, ``counter`` their Counters. Shapes (n,).
    """

    frames: FrameRows | LazyRows
    stream: I64
    list: I64
    time_ns: I64
    frame: I64
    counter: I64

    @property
    def rows(self) -> FrameRows:
        """All that was found in them."""
        return self.frames.rows if isinstance(self.frames, LazyRows) else self.frames

    def __len__(self) -> int:
        return len(self.stream)


class LazyRows:
    """Rows of some packets of a batch that are made when somebody asks for them."""

    def __init__(self, told: Told, packet: I64) -> None:
        self.told, self.packet = told, packet

    @property
    def are_telegrams(self) -> bool:
        """Whether nothing but telegrams of network variables was found in the batch."""
        return self.told.can is None and not self.told.parts and self.told.others is None

    @cached_property
    def rows(self) -> FrameRows:
        """The rows."""
        return FrameRows.of(self.told, self.packet)


class Runs(Struct, frozen=True):
    """The telegrams of a batch by stream, or the frames of CAN; and the number of the list that each run is of."""

    rows: DataRows
    lists: I64
    on_can: bool

    def before_ns(self, run: int) -> I64:
        """Return the times of the telegrams before those of a run; of one that has none, its own."""
        rows = self.rows
        start, stop = int(rows.start[run]), int(rows.stop[run])
        first = rows.time_ns[start] if rows.fresh[run] else rows.before_ns[run]
        return np.append(first, rows.time_ns[start : stop - 1])


class _Batch(Struct):
    """What was made of a batch so far."""

    told: Told
    latest_ns: I64
    runs: list[Runs]
    asked: dict[OfLists | None, Asked] = field(default_factory=dict)


class AskedRows:
    """Makes the rows of batches; whoever asks of one batch what another one asked gets the same.

    ``names`` are what lists are called.
    """

    def __init__(self, names: Mapping[ListKey, str]) -> None:
        self._names = names
        self._batch: _Batch | None = None
        self._latest_ns: int | None = None
        self._streams = TelegramStreams()
        self._keys: list[ListKey] = []
        self._own: dict[OfLists, Bool] = {}

    def of(self, told: Told, lists: OfLists | None = None) -> Asked:
        """Return the telegrams of some lists of a batch that has some, or all in which something was found."""
        batch = self._batch_of(told)
        if lists not in batch.asked:
            batch.asked[lists] = self._all(batch) if lists is None else self._some(batch, lists)
        return batch.asked[lists]

    def runs(self, told: Told, lists: OfLists) -> Iterator[tuple[Runs, list[int]]]:
        """Yield the telegrams of a batch by stream, with the places of the runs that are of some lists."""
        batch = self._batch_of(told)
        mask = self.mask(lists, told.keys)
        for one in batch.runs:
            if own := np.flatnonzero(mask[one.lists]).tolist():
                yield one, own

    def latest_ns(self, told: Told) -> I64:
        """Return for each packet of a batch the latest time up to it, of all packets so far."""
        return self._batch_of(told).latest_ns

    def own(self, asked: Asked, lists: OfLists, keys: Keys) -> Bool:
        """Tell which telegrams are of some lists."""
        mask = np.append(self.mask(lists, keys), False)
        found: Bool = mask[asked.list]
        return found

    def _batch_of(self, told: Told) -> _Batch:
        if self._batch is None or self._batch.told.batch is not told.batch:
            time_ns = told.packets.ts_ns
            if self._latest_ns is not None and len(time_ns):
                time_ns = np.maximum(time_ns, self._latest_ns)
            latest_ns = np.maximum.accumulate(time_ns)
            self._latest_ns = int(latest_ns[-1])
            laid = told.laid
            runs = [
                Runs(rows, laid.keys.described(rows.run_stream)[0], rows is laid.pdos)
                for rows in (laid.data, laid.pdos)
                if len(rows)
            ]
            self._batch = _Batch(told, latest_ns, runs)
        return self._batch

    def mask(self, lists: OfLists, keys: Keys) -> Bool:
        """Tell of each list, by number, whether it is one of some."""
        known = self._own.get(lists, np.zeros(0, np.bool_))
        if len(known) < len(keys.lists):
            self._keys += [keys.list_key(number) for number in range(len(self._keys), len(keys.lists))]
            new = lists.among(self._keys[len(known) :], self._names)
            known = self._own[lists] = np.append(known, np.array(new, np.bool_))
        return known

    def _some(self, batch: _Batch, lists: OfLists) -> Asked:
        mask = self.mask(lists, batch.told.keys)
        packets, streams, numbers, runs = [], [], [], 0
        for one in batch.runs:
            rows, run = one.rows, np.flatnonzero(mask[one.lists])
            row = rows.of_runs(run)
            packets.append(rows.packet[row])
            streams.append(rows.stream[row])
            numbers.append(np.repeat(one.lists[run], rows.stop[run] - rows.start[run]))
            runs += len(run)
        in_order = runs < 2
        return _asked(batch, *(_joined(columns) for columns in (packets, streams, numbers)), in_order=in_order)

    def _all(self, batch: _Batch) -> Asked:
        told = batch.told
        numbers = np.full(len(told), _NO_LIST)
        for one in batch.runs:
            numbers[one.rows.packet] = np.repeat(one.lists, one.rows.stop - one.rows.start)
        packet = told.wanted
        return _asked(batch, packet, self._streams.of(told, packet), numbers[packet])


def _joined(columns: Sequence[I64]) -> I64:
    return np.concatenate(columns) if columns else np.zeros(0, np.int64)


def _asked(batch: _Batch, packet: I64, stream: I64, numbers: I64, *, in_order: bool = False) -> Asked:
    told = batch.told
    if not in_order:
        order = np.argsort(packet, kind="stable")
        packet, stream, numbers = packet[order], stream[order], numbers[order]
    return Asked(
        LazyRows(told, packet), stream, numbers, batch.latest_ns[packet], packet + told.first_frame,
        told.counter[packet].astype(np.int64),
    )  # fmt: skip
