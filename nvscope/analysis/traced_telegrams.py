"""Variables of lists as what is traced: their values, and where telegrams are missing between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.analysis.tracing import Numbers, Points
from nvscope.analysis.watching import Scene
from nvscope.causes.mark import Mark
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.variables import Elementary
from nvscope.engine.run import run
from nvscope.engine.told import Told
from nvscope.list_key import ListKey, Transport
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined
from nvscope.tracker.variables.values import Block
from nvscope.view.value_texts import value_text

SILENT_PERCENT = 250
"""A stream is silent from so much of its nominal interval on: two of its telegrams are late then."""

_LOST_PERCENT = 150
"""Between two telegrams of a stream that are no further apart, none of its own was lost. On CAN nothing counts frames:
between those that are further apart, one was."""


class TracedElement(Struct, frozen=True):
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

    @property
    def holds(self) -> bool:
        """Nobody knows what it was between two telegrams."""
        return False

    def finder(self) -> TelegramFinder:
        """Return what finds its values."""
        return TelegramFinder(self)

    def type_of(self, value: Numbers) -> Elementary:
        """Return its type."""
        return self.type

    def text(self, value: Any) -> str:
        """Return one of its values as ``vars`` has it."""
        return value_text(self.type, value.tobytes())


class TelegramFinder:
    """Finds the values of an element in telegrams (``nvscope.analysis.tracing.Finder``)."""

    def __init__(self, traced: TracedElement) -> None:
        self._traced = traced
        self._block = traced.block
        self._last_ns: int | None = None

    def begin(self, scene: Scene) -> None:
        self._last_ns = None

    def skip(self) -> None:
        self._last_ns = None

    def find(self, scene: Scene, first_frame: int, nominal_ns: int | None) -> Iterator[tuple[Sequence[Points], int]]:
        lost_ns = _lost_ns(scene, self._traced.list)
        stream = _OfStream(self._traced)
        for _ in run(scene.frames(first_frame), scene.inquiry.reading(), [stream]):
            points = self._points(stream.telegrams, first_frame - 1, nominal_ns, lost_ns)
            yield points, first_frame + stream.read.frames

    def _points(
        self, parts: list[Telegrams], before: int, nominal_ns: int | None, lost_ns: I64
    ) -> Sequence[Points]:  # fmt: skip
        """Return the values in telegrams; ``before`` is how many frames there were before those that they count."""
        if not parts:
            return ()
        fits = [(part.items, part.data.shape[1]) == self._traced.layout.shape for part in parts]
        value = np.concatenate([self._values(part, good) for part, good in zip(parts, fits, strict=True)])
        frame = np.concatenate([part.frame for part in parts]) + before
        time_ns = np.concatenate([part.time_ns for part in parts])
        kept = np.repeat(np.array(fits), [len(part.frame) for part in parts])
        found = Points(time_ns, frame, value, kept, np.zeros(len(frame), np.bool_))
        if len(parts) > 1:
            found = found.take(np.argsort(frame))
        now_ns = found.time_ns
        before_ns = np.append(now_ns[0] if self._last_ns is None else self._last_ns, now_ns[:-1])
        self._last_ns = int(now_ns[-1])
        on_can = self._traced.list.transport is Transport.CAN
        return [replace(found, apart=_gaps(before_ns, now_ns, nominal_ns, lost_ns, on_can=on_can))]

    def _values(self, part: Telegrams, fits: bool) -> Numbers:
        if not fits:
            return np.zeros(len(part.frame), self._block.number_dtype)
        numbers = self._block.numbers_of(self._block.cells_of(part.data))
        assert numbers is not None
        return numbers.reshape(-1)


class _OfStream:
    """The telegrams of one stream in the batch that was observed last."""

    by_stream: ClassVar[bool] = True

    def __init__(self, traced: TracedElement) -> None:
        self.read = DataTelegrams(lambda stream: _is_of(stream, traced))
        self.telegrams: list[Telegrams] = []

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        self.telegrams = joined(self.read.of(told))


def _is_of(stream: Stream, traced: TracedElement) -> bool:
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
