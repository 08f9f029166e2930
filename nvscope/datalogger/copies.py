"""Copies: telegrams that came again, byte for byte and with the same Counter, and are no cycle of their own.

A mirror port shows a frame twice, two interfaces or two captures have it both, and a sender that waits for an
acknowledgement sends it once more. Which ones these are, ``nvscope.datalogger.repeats`` tells.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U16, U64, Bool
from dissectors.columns import Columns
from nvscope.datalogger.contents import contents_of, mixed
from nvscope.datalogger.repeats import Seen
from nvscope.datalogger.wanted import WantedStreams
from nvscope.engine.keys import COUNTER_SHIFT
from nvscope.engine.rows import DataRows
from nvscope.engine.told import Told
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.steps import EARLY_WRAPS

BLOCK = 512
"""So many telegrams of a stream are judged at a time, by those and as many before and behind them."""


class _Telegrams(Columns, Struct, frozen=True):
    """Telegrams of a stream in their order, as ``Seen`` has them."""

    time_ns: I64
    counter: U16
    values: U64
    content: U64
    frame: I64


class _Stream(Struct):
    """The last telegrams of a stream; of the first ``judged`` of them it is known what they are."""

    defined_ns: int | None
    telegrams: _Telegrams
    judged: int = 0

    def __len__(self) -> int:
        return len(self.telegrams)

    def append(self, telegrams: _Telegrams) -> None:
        """Take telegrams that follow."""
        self.telegrams = _Telegrams.stacked([self.telegrams, telegrams])

    def forget(self) -> None:
        """Forget telegrams by which none will be judged."""
        # Taken by numbers, which copies: nothing else of a batch is kept.
        self.telegrams = self.telegrams.take(np.arange(max(self.judged - BLOCK, 0), len(self)))
        self.judged = min(self.judged, BLOCK)

    def judge(self, until: int, end: int) -> I64:
        """Return the frames of the copies that are not judged yet, up to ``until``, by telegrams up to ``end``."""
        begin, judged = max(self.judged - BLOCK, 0), self.judged
        self.judged = until
        own, part = self.telegrams, slice(begin, end)
        # Who counts on and on repeats nothing.
        if (np.diff(own.counter[part]).view(np.int16) > 0).all():
            return np.empty(0, np.int64)
        seen = Seen(own.time_ns[part], own.counter[part], own.values[part], own.content[part], self.defined_ns)
        copies: I64 = np.flatnonzero(seen.copies()[judged - begin : until - begin])
        return own.frame[judged + copies]


class Copies:
    """Finds the copies among the telegrams of some lists, batch by batch; an observer.

    ``defined_ns`` are the intervals of lists by definition, 0 where they are not sent cyclically. Of a whole capture,
    ``found`` are all of them: what follows a telegram tells what it is, and however it is cut into batches, they are
    the same. Who cannot wait asks for those of each batch (``at_once``), by what came so far.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, keys: Collection[ListKey], defined_ns: Mapping[ListKey, int]) -> None:
        self._wanted = WantedStreams(keys)
        self._defined_ns = defined_ns
        self._streams: dict[int, _Stream] = {}
        self._found: list[I64] = [np.empty(0, np.int64)]

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for stream in self._observed(told):
            while len(stream) - stream.judged >= 2 * BLOCK:
                until = stream.judged + BLOCK
                self._found.append(stream.judge(until, until + BLOCK))
            stream.forget()
        if told.is_deaf:
            self._end()

    def at_once(self, told: Told) -> I64:
        """Take a batch, and return the frames of the copies in it, rising."""
        self._found = [np.empty(0, np.int64)]
        for stream in self._observed(told):
            self._found.append(stream.judge(len(stream), len(stream)))
            stream.forget()
        if told.is_deaf:
            self._streams.clear()
        return np.sort(np.concatenate(self._found))

    def found(self) -> I64:
        """Return the frames of all copies, rising, when nothing follows any more."""
        self._end()
        self._found = [np.sort(np.concatenate(self._found))]
        return self._found[0]

    def _observed(self, told: Told) -> Iterator[_Stream]:
        """Yield the wanted streams of a batch, with its telegrams."""
        wanted = self._wanted.of(told)
        if not len(told.laid.data):
            return
        rows = told.laid.data.of(wanted)
        if not len(rows):
            return
        values = contents_of(told, rows)
        content, frame = mixed(values, rows.counter.astype(np.uint64)), rows.packet + told.first_frame
        runs = zip(*(column.tolist() for column in (rows.run_stream, rows.start, rows.stop, rows.fresh)), strict=True)
        for number, start, stop, is_fresh in runs:
            own = slice(start, stop)
            new = _Telegrams(rows.time_ns[own], rows.counter[own], values[own], content[own], frame[own])
            known = self._streams.get(number)
            if known is not None and is_fresh:
                # Another recording may be of a sender that counts in another way.
                self._found.append(known.judge(len(known), len(known)))
                known = None
            if known is None:
                defined_ns = told_of(self._defined_ns, told.keys.place_key(number)[0]) or None
                known = self._streams[number] = _Stream(defined_ns, new)
            else:
                known.append(new)
            yield known

    def _end(self) -> None:
        """Judge what is left; nothing follows it."""
        for stream in self._streams.values():
            self._found.append(stream.judge(len(stream), len(stream)))
        self._streams.clear()


def may_be_copies(rows: DataRows, wanted: Bool) -> bool:
    """Tell whether there may be copies among telegrams of streams that are wanted; of most captures there are none.

    A copy is as the telegram before it in its stream, or the Counter goes back in front of it.
    """
    if not len(rows):
        return False
    if rows.repeated is not None and wanted[rows.stream[rows.repeated]].any():
        return True
    step = np.empty(len(rows), np.uint16)
    np.subtract(rows.counter[1:], rows.counter[:-1], out=step[1:])
    before = (rows.signature_before >> COUNTER_SHIFT).astype(np.uint16)
    step[rows.start] = np.where(rows.fresh, 0, rows.counter[rows.start] - before)
    back = np.flatnonzero(step.view(np.int16) < 0)
    # A Counter that begins anew early.
    before_zero = (0 - step[back]).astype(np.uint16)
    wraps = np.logical_or.reduce([before_zero == one for one in EARLY_WRAPS])
    back = back[(rows.counter[back] != 0) | ~wraps]
    return bool(wanted[rows.stream[back]].any())
