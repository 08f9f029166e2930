"""History: each change of some variables, in the order of the capture, and how often and how fast they change."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined
from nvscope.tracker.variables.values import MOST_LAYOUTS, Block, blocks_of

_AT_ONCE = 1 << 14

Wanted = Callable[[ListKey, int], frozenset[str]]
"""Given list and SubIndex of a telegram, returns the names of its elements that are wanted."""


class Track(Struct):
    """What is known of the wanted elements of one stream in one layout.

    Columns have an entry a wanted element, as ``places`` has. ``changes`` counts the changes, of which the last was at
    ``changed_ns``; ``shortest_ns`` and ``longest_ns`` are times between two changes, -1 where there is none. Where a
    clock steps back, or nobody listened, a time between changes is left out: ``unheard`` are the changes up to when
    that was last. ``data`` are the bytes of the last telegram since somebody listens, None before it.
    """

    stream: Stream
    layout: TelegramLayout
    places: tuple[int, ...]
    blocks: tuple[tuple[Block, I64, I64], ...]
    """Blocks with wanted elements: which ones, counted within the block, and their entries in the columns."""

    telegrams: int
    first_ns: int
    last_ns: int
    changes: I64
    changed_ns: I64
    shortest_ns: I64
    longest_ns: I64
    unheard: I64
    data: U8 | None = None


class Entry(Struct, frozen=True):
    """One element in one telegram: its bytes there, and in the telegram before, None where nobody has seen that."""

    frame: int
    time_ns: int
    track: Track
    place: int
    changed: bool
    before: bytes | None
    now: bytes


class History:
    """The changes of wanted elements, told as batches come; however these are cut, it is the same.

    What is a change is said in ``tracker.variables.values``. Behind a time in which nobody listened it begins anew,
    with the first telegram's values. With ``every`` the elements of each telegram are told, changed or not. Of several
    definitions of a list, the first that fits a telegram is taken; where another one fits, what comes is compared with
    what that one fitted before. ``tracks`` are what was seen, by stream, Items and bytes of data; ``unfitting`` counts
    the telegrams that have the list and SubIndex of a wanted element, but other Items or Length than its definitions;
    ``unlike_known_part`` those that differ from what is known of a definition, where an element has no known size.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, layouts: Layouts, wanted: Wanted, *, every: bool = False) -> None:
        self._layouts = layouts
        self._wanted = wanted
        self._every = every
        self.read = DataTelegrams(lambda stream: bool(self._names(stream)))
        self.tracks: dict[tuple[int, int, int], Track] = {}
        self._shapes: dict[int, int] = {}
        self._shown: list[_Shown] = []
        self.unfitting = self.unlike_known_part = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for unheard in told.unheard:
            for track in self.tracks.values():
                if track.stream.number in unheard.streams:
                    track.unheard, track.data = track.changes.copy(), None
        self._shown = [shown for part in joined(self.read.of(told)) if (shown := self._add(part)) is not None]

    def entries(self) -> Iterator[Entry]:
        """Yield what the batch observed last tells."""
        return _merged(self._shown)

    def _names(self, stream: Stream) -> frozenset[str]:
        return self._wanted(stream.list, stream.subindex)

    def _new_track(self, stream: Stream, telegrams: Telegrams) -> Track | None:
        """Return what is to be known of telegrams of a new shape; None where no definition has that shape."""
        shape = telegrams.items, telegrams.data.shape[1]
        layout = self._layouts.telegram_of(stream.list, stream.subindex, shape)
        shapes = self._shapes.get(stream.number, 0)
        if layout is None or shape != layout.shape:
            return None
        if shapes >= MOST_LAYOUTS and not self._layouts.candidates_of(stream.list):
            return None
        self._shapes[stream.number] = shapes + 1
        return _new_track(stream, layout, self._names(stream), int(telegrams.time_ns[0]))

    def _add(self, telegrams: Telegrams) -> _Shown | None:
        stream = telegrams.stream
        key = stream.number, telegrams.items, telegrams.data.shape[1]
        track = self.tracks.get(key)
        if track is None:
            track = self._new_track(stream, telegrams)
            if track is None:
                if self._layouts.partly_of(stream.list):
                    self.unlike_known_part += len(telegrams.frame)
                else:
                    self.unfitting += len(telegrams.frame)
                return None
            self.tracks[key] = track
        if not track.places:
            return None
        fresh = track.data is None
        before = telegrams.data[:1] if track.data is None else track.data[np.newaxis]
        whole = np.concatenate([before, telegrams.data])
        differs = np.zeros((len(telegrams.frame), len(track.places)), np.bool_)
        for block, inside, columns in track.blocks:
            cells = block.cells_of(whole)
            if block.count == 1 and cells.ndim == 1:
                cells = cells[:, np.newaxis]
            changed = cells[1:, inside] != cells[:-1, inside]
            differs[:, columns] = changed.any(axis=2) if changed.ndim == 3 else changed
        _count(track, differs, telegrams.time_ns)
        track.data = telegrams.data[-1].copy()
        track.telegrams += len(telegrams.frame)
        track.last_ns = int(telegrams.time_ns[-1])
        told = np.ones_like(differs) if self._every else differs.copy()
        told[0] |= fresh
        row, column = np.nonzero(told)
        return _Shown(track, telegrams, whole, differs, fresh, row, column)


class _Shown(Struct, frozen=True):
    """What is to be told of one stream: ``row`` and ``column`` of its table of telegrams and elements."""

    track: Track
    telegrams: Telegrams
    whole: U8
    differs: Bool
    fresh: bool
    row: I64
    column: I64


def _new_track(stream: Stream, layout: TelegramLayout, wanted: frozenset[str], time_ns: int) -> Track:
    places = tuple(place for place, element in enumerate(layout.elements) if element.name in wanted)
    every = np.array(places, np.int64)
    blocks = []
    for block in blocks_of(layout):
        columns = np.flatnonzero((every >= block.first) & (every < block.first + block.count))
        if len(columns):
            blocks.append((block, every[columns] - block.first, columns))
    count = len(places)
    return Track(
        stream, layout, places, tuple(blocks), 0, time_ns, time_ns, np.zeros(count, np.int64),
        np.zeros(count, np.int64), np.full(count, -1), np.full(count, -1), np.zeros(count, np.int64),
    )  # fmt: skip


def _count(track: Track, differs: Bool, time_ns: I64) -> None:
    """Add the changes of some telegrams to the figures of a track."""
    column, row = np.nonzero(differs.T)
    if not len(column):
        return
    when = time_ns[row]
    starts = np.append(True, column[1:] != column[:-1])
    before = np.empty_like(when)
    before[1:] = when[:-1]
    before[starts] = track.changed_ns[column[starts]]
    between = when - before
    timed = (between >= 0) & (~starts | (track.changes > track.unheard)[column])
    most = np.iinfo(np.int64).max
    shortest = np.where(track.shortest_ns < 0, most, track.shortest_ns)
    np.minimum.at(shortest, column[timed], between[timed])
    track.shortest_ns = np.where(shortest == most, -1, shortest)
    np.maximum.at(track.longest_ns, column[timed], between[timed])
    track.changes += np.bincount(column, minlength=len(track.changes))
    last = np.append(starts[1:], True)
    track.changed_ns[column[last]] = when[last]


def _merged(shown: list[_Shown]) -> Iterator[Entry]:
    """Yield the entries of several streams in the order of the capture."""
    if not shown:
        return
    source = np.repeat(np.arange(len(shown)), [len(part.row) for part in shown])
    frame = np.concatenate([part.telegrams.frame[part.row] for part in shown])
    row, column = np.concatenate([part.row for part in shown]), np.concatenate([part.column for part in shown])
    time_ns = np.concatenate([part.telegrams.time_ns[part.row] for part in shown])
    differs = np.concatenate([part.differs[part.row, part.column] for part in shown])
    order = np.lexsort((column, frame))
    spans = [_spans(part.track) for part in shown]
    # As Python's own numbers and bytes: those of numpy are slow one by one.
    data = [(part.whole.tobytes(), part.whole.shape[1]) for part in shown]
    for first in range(0, len(order), _AT_ONCE):
        rows = order[first : first + _AT_ONCE]
        told = (values[rows].tolist() for values in (source, row, column, frame, time_ns, differs))
        for number, line, entry, frame_number, when, changed in zip(*told, strict=True):
            part, (whole, length), (begin, end) = shown[number], data[number], spans[number][entry]
            above, here = line * length, (line + 1) * length
            before = None if part.fresh and not line else whole[above + begin : above + end]
            now = whole[here + begin : here + end]
            yield Entry(frame_number, when, part.track, part.track.places[entry], changed, before, now)


def _spans(track: Track) -> list[tuple[int, int]]:
    """Return where the wanted elements begin and end in a telegram."""
    layout = track.layout
    begin = [layout.layout.offset_of(str(place)) for place in track.places]
    return [(at, at + layout.elements[place].type.size_bytes) for at, place in zip(begin, track.places, strict=True)]
