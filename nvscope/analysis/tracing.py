"""Tracing: what one variable was over the time that the ring of a scene holds, each frame read once.

Points are bounded in number: where there are too many, of each few that follow each other the least and the greatest
stay. So extremes are kept as they were, however long it goes on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from dissectors.batch import I64, Bool
from nvscope.analysis.watching import Scene
from nvscope.causes.mark import Mark
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.variables import Elementary
from nvscope.engine.ring import Recent
from nvscope.engine.run import run
from nvscope.engine.told import Told
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined
from nvscope.tracker.variables.values import Block

MOST_POINTS = 200_000

SILENT_PERCENT = 250
"""A stream is silent from so much of its nominal interval on: two of its telegrams are late then."""

_LOST_PERCENT = 150
"""Between two telegrams of a stream that are no further apart, none of its own was lost. On CAN nothing counts frames:
between those that are further apart, one was."""

_BUCKET = 4

Numbers = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Traced:
    """A variable: element ``place`` of a layout of telegrams of a list, with a SubIndex, of a sender."""

    list: ListKey
    subindex: int
    sender: str
    layout: TelegramLayout
    place: int

    @property
    def type(self) -> Elementary:
        return self.layout.elements[self.place].type

    @property
    def block(self) -> Block:
        """Where its bytes are in the data of a telegram."""
        return Block(0, 1, self.layout.layout.offset_of(str(self.place)), self.type)

    @property
    def has_numbers(self) -> bool:
        """Whether its values have an order, so that they can be traced."""
        return self.block.number_dtype is not None


@dataclass(frozen=True, slots=True)
class Trace:
    """The values of a variable, in the order in which they came; a value that stays as it is.

    ``value`` has the numbers as the type has them, ``run`` a number that is another one behind a gap: where nothing
    came, telegrams were lost, had another shape, or held no number. All are of shape (n,). ``start_ns`` is when the
    first frame came that was read, None where none was, ``stop_frame`` the frame behind the last one. ``thinned``: not
    all values that came are there.
    """

    time_ns: I64
    frame: I64
    value: Numbers
    run: I64
    start_ns: int | None
    stop_frame: int
    thinned: bool = False

    def at(self, time_ns: int) -> int | None:
        """Return the last point that is not later than a time, None where there is none."""
        found = np.flatnonzero(self.time_ns <= time_ns)
        return int(found[-1]) if len(found) else None


class Tracing:
    """Reads the values of one variable from scenes that follow each other.

    Of a scene that is not behind those before, as one of the past is not, all is read anew.
    """

    def __init__(self, traced: Traced, most_points: int = MOST_POINTS) -> None:
        self.traced = traced
        self._most = most_points
        self._block = traced.block
        self._begin(0)

    def _begin(self, frame: int) -> None:
        none = np.empty(0, np.int64)
        self._time_ns, self._frame, self._run = none, none, none
        self._value: Numbers = np.empty(0, self._block.number_dtype)
        self._first = self._stop = frame
        self._last_ns: int | None = None  # of the last value, None where what follows is not joined to it
        self._number = 0
        self._thinned = False

    def read(self, scene: Scene, nominal_ns: int | None = None) -> Iterator[Trace]:
        """Read the frames of a scene that were not read yet; yield what is known behind each part of them.

        ``nominal_ns`` is the interval at which the stream should come, None where nobody knows. Who stops asking stops
        the reading, which goes on there another time.
        """
        recent = scene.recent
        if recent.stop_frame < self._stop or recent.first_frame < self._first or not self._stop:
            self._begin(recent.first_frame)
        if recent.first_frame > self._stop:  # some were let go that nobody has read
            self._stop, self._last_ns = recent.first_frame, None
        lost_ns = _lost_ns(scene, self.traced.list)
        first, stream = self._stop, _OfStream(self.traced)
        yield self._trace(recent)
        for _ in run(scene.frames(first), scene.inquiry.reading(), [stream]):
            self._take(stream.telegrams, first - 1, nominal_ns, lost_ns)
            self._stop = first + stream.read.frames
            yield self._trace(recent)

    def _trace(self, recent: Recent) -> Trace:
        """Return what is known, without what the ring has let go."""
        gone = int(np.searchsorted(self._frame, recent.first_frame))
        if gone:
            self._time_ns, self._frame, self._run = self._time_ns[gone:], self._frame[gone:], self._run[gone:]
            self._value = self._value[gone:]
        self._first = recent.first_frame
        return Trace(
            self._time_ns, self._frame, self._value, self._run, recent.first_ns, self._stop, self._thinned
        )  # fmt: skip

    def _take(self, parts: list[Telegrams], before: int, nominal_ns: int | None, lost_ns: I64) -> None:
        """Take telegrams of the stream; ``before`` is how many frames were there before those that they count from."""
        if not parts:
            return
        fits = [(part.items, part.data.shape[1]) == self.traced.layout.shape for part in parts]
        value = np.concatenate([self._values(part, good) for part, good in zip(parts, fits, strict=True)])
        frame = np.concatenate([part.frame for part in parts]) + before
        time_ns = np.concatenate([part.time_ns for part in parts])
        kept = np.repeat(np.array(fits), [len(part.frame) for part in parts])
        if value.dtype.kind == "f":
            kept &= ~np.isnan(value)
        if len(parts) > 1:
            order = np.argsort(frame)
            value, frame, time_ns, kept = value[order], frame[order], time_ns[order], kept[order]
        self._append(value, frame, time_ns, kept, nominal_ns, lost_ns)
        while len(self._frame) > self._most:
            if not self._thin():
                break

    def _values(self, part: Telegrams, fits: bool) -> Numbers:
        if not fits:
            return np.zeros(len(part.frame), self._block.number_dtype)
        numbers = self._block.numbers_of(self._block.cells_of(part.data))
        assert numbers is not None
        return numbers.reshape(-1)

    def _append(
        self, value: Numbers, frame: I64, time_ns: I64, kept: Bool, nominal_ns: int | None, lost_ns: I64
    ) -> None:
        left_out = np.cumsum(~kept)
        row = np.flatnonzero(kept)
        if not len(row):
            self._last_ns = None
            return
        now_ns = time_ns[row]
        before_ns = np.append(now_ns[0] if self._last_ns is None else self._last_ns, now_ns[:-1])
        parted = np.append(left_out[row[0]] > 0 or self._last_ns is None, np.diff(left_out[row]) > 0)
        parted |= _gaps(
            before_ns, now_ns, nominal_ns, lost_ns, on_can=self.traced.list.transport is Transport.CAN
        )  # fmt: skip
        self._time_ns = np.concatenate([self._time_ns, now_ns])
        self._frame = np.concatenate([self._frame, frame[row]])
        self._value = np.concatenate([self._value, value[row]])
        self._run = np.concatenate([self._run, self._number + np.cumsum(parted)])
        self._number = int(self._run[-1])
        self._last_ns = int(now_ns[-1]) if kept[-1] else None

    def _thin(self) -> bool:
        """Keep of each few values the least and the greatest; tell whether any could go."""
        whole = len(self._frame) // _BUCKET * _BUCKET
        table = self._value[:whole].reshape(-1, _BUCKET)
        start = np.arange(0, whole, _BUCKET)
        kept = np.zeros(len(self._frame), np.bool_)
        kept[start + table.argmin(axis=1)] = True
        kept[start + table.argmax(axis=1)] = True
        kept[whole:] = True
        self._time_ns, self._frame, self._run = self._time_ns[kept], self._frame[kept], self._run[kept]
        self._value = self._value[kept]
        self._thinned = True
        return not kept.all()


class _OfStream:
    """The telegrams of one stream in the batch that was observed last."""

    by_stream: ClassVar[bool] = True

    def __init__(self, traced: Traced) -> None:
        self.read = DataTelegrams(lambda stream: _is_of(stream, traced))
        self.telegrams: list[Telegrams] = []

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.telegrams = joined(self.read.of(told))


def _is_of(stream: Stream, traced: Traced) -> bool:
    return (stream.list, stream.subindex, stream.sender) == (traced.list, traced.subindex, traced.sender)


def _gaps(before_ns: I64, now_ns: I64, nominal_ns: int | None, lost_ns: I64, *, on_can: bool) -> Bool:
    """Return which telegrams do not go on where the ones before them ended."""
    between_ns = now_ns - before_ns
    place = np.searchsorted(lost_ns, before_ns, "right")
    lost = np.append(lost_ns, np.iinfo(np.int64).max)[place] < now_ns
    if nominal_ns:
        # Of a list of several SubIndexes it is known when it lost some, and not of which.
        lost &= between_ns * 100 > nominal_ns * _LOST_PERCENT
        lost |= between_ns * 100 > nominal_ns * (_LOST_PERCENT if on_can else SILENT_PERCENT)
    gaps: Bool = lost | (between_ns < 0)
    return gaps


def _lost_ns(scene: Scene, key: ListKey) -> I64:
    """Return when telegrams of a list should have come that were lost, the first of each that were lost together."""
    happened = scene.snapshot.happened
    number = None if happened is None else happened.chronicle.numbers.get(str(key))
    if happened is None or number is None:
        return np.empty(0, np.int64)
    lists, since_ns, _, mark = happened.chronicle.marks
    return np.sort(since_ns[(lists == number) & (mark == Mark.LOST.value)])
