"""Tracing: what one variable was over the time that the ring of a scene holds, each frame read once.

Points are bounded in number: where there are too many, of each few that follow each other the least and the greatest
stay. So extremes are kept as they were, however long it goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64, Bool
from nvscope.analysis.watching import Scene
from nvscope.definition.variables import Elementary
from nvscope.engine.ring import Recent

MOST_POINTS = 200_000

_BUCKET = 4

Numbers = npt.NDArray[Any]


class Points(Struct, frozen=True):
    """Values of a variable, in the order in which they came; all are of shape (n,).

    Those that are not ``kept`` are no number, and part those around them. ``apart``: nobody knows what was between it
    and the one before.
    """

    time_ns: I64
    frame: I64
    value: Numbers
    kept: Bool
    apart: Bool

    def take(self, rows: I64) -> Points:
        """Return some of them."""
        return Points(
            self.time_ns[rows], self.frame[rows], self.value[rows], self.kept[rows], self.apart[rows]
        )  # fmt: skip


class Finder(Protocol):
    """Finds the values of one variable in the frames of rings, which follow each other."""

    def begin(self, scene: Scene) -> None:
        """Begin anew, with the frames of a scene."""
        ...

    def skip(self) -> None:
        """Take that frames are missing in front of those that come next."""
        ...

    def find(self, scene: Scene, first_frame: int, nominal_ns: int | None) -> Iterator[tuple[Sequence[Points], int]]:
        """Yield what the frames of a scene have from one on, part by part, and the number of the frame behind each."""
        ...


class Traced(Protocol):
    """A variable that is traced. ``holds``: it is known that a value stays as it is until the next one comes."""

    @property
    def has_numbers(self) -> bool:
        """Whether its values have an order, so that they can be traced."""
        ...

    @property
    def holds(self) -> bool: ...

    def finder(self) -> Finder:
        """Return what finds its values."""
        ...

    def type_of(self, value: Numbers) -> Elementary:
        """Return the type of some of its values."""
        ...

    def text(self, value: Any) -> str:
        """Return one of its values as ``vars`` has it."""
        ...


class Trace(Struct, frozen=True):
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
        self._finder = traced.finder()
        self._begin(0)

    def _begin(self, frame: int) -> None:
        none = np.empty(0, np.int64)
        self._time_ns, self._frame, self._run = none, none, none
        self._value: Numbers | None = None
        self._first = self._stop = frame
        self._is_joined = False  # what comes next may go on where the last value was
        self._number = 0
        self._thinned = False

    def read(self, scene: Scene, nominal_ns: int | None = None) -> Iterator[Trace]:
        """Read the frames of a scene that were not read yet; yield what is known behind each part of them.

        ``nominal_ns`` is the interval at which its stream should come, None where nobody knows. Who stops asking stops
        the reading, which goes on there another time.
        """
        recent = scene.recent
        if recent.stop_frame < self._stop or recent.first_frame < self._first or not self._stop:
            self._begin(recent.first_frame)
            self._finder.begin(scene)
        if recent.first_frame > self._stop:  # some were let go that nobody has read
            self._stop, self._is_joined = recent.first_frame, False
            self._finder.skip()
        yield self._trace(recent)
        for parts, stop in self._finder.find(scene, self._stop, nominal_ns):
            for points in parts:
                self._take(points)
            self._stop = stop
            yield self._trace(recent)

    def _trace(self, recent: Recent) -> Trace:
        """Return what is known, without what the ring has let go."""
        value = np.empty(0) if self._value is None else self._value
        gone = int(np.searchsorted(self._frame, recent.first_frame))
        if gone:
            self._time_ns, self._frame, self._run = self._time_ns[gone:], self._frame[gone:], self._run[gone:]
            self._value = value = value[gone:]
        self._first = recent.first_frame
        return Trace(self._time_ns, self._frame, value, self._run, recent.first_ns, self._stop, self._thinned)

    def _take(self, points: Points) -> None:
        if not len(points.frame):
            return
        kept = points.kept
        if points.value.dtype.kind == "f":
            kept = kept & ~np.isnan(points.value)
        row = np.flatnonzero(kept)
        if not len(row):
            self._is_joined = False
            return
        # Whatever parts some of those that are not kept parts those around them.
        parts = np.cumsum(points.apart | ~kept)[row]
        parted = np.append(parts[0] > 0 or not self._is_joined, np.diff(parts) > 0)
        value = points.value[row]
        self._time_ns = np.concatenate([self._time_ns, points.time_ns[row]])
        self._frame = np.concatenate([self._frame, points.frame[row]])
        self._value = value if self._value is None else np.concatenate([self._value, value])
        self._run = np.concatenate([self._run, self._number + np.cumsum(parted)])
        self._number = int(self._run[-1])
        self._is_joined = bool(kept[-1])
        while len(self._frame) > self._most:
            if not self._thin():
                break

    def _thin(self) -> bool:
        """Keep of each few values the least and the greatest; tell whether any could go."""
        assert self._value is not None
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
