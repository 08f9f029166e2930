"""RecentFrames: which frames of a ring are shown, and which of them a filter chooses, kept as scenes follow each other.

A ring is looked at in steps, and each frame once: whoever shows a scene need not wait for the frames before it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct, field
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from dissectors.carried import Carrier
from dissectors.varieties import Varieties
from nvscope.analysis.read_values import SOURCES
from nvscope.capture.source import SourceInfo
from nvscope.engine.reading import Reading
from nvscope.engine.recogniser import Before, Recogniser
from nvscope.engine.ring import Chunk, Recent
from nvscope.engine.told import Told
from nvscope.list_key import ListKey

if TYPE_CHECKING:
    from nvscope.analysis.watching import Scene
    from nvscope.tracker.readings.readings import ReadValues
    from nvscope.view.display_filter import DisplayFilter

STEP_FRAMES = 32_768
"""So many frames are looked at in one step: some hundredths of a second."""

_NO_PLACE = -1


def _no_frames() -> I64:
    return np.empty(0, np.int64)


class Wanted(Struct, frozen=True):
    """Which frames are wanted: those that an expression chooses, of one list; None for no matter which."""

    expression: str | None = None
    list_key: str | None = None


EVERYTHING = Wanted()


class FoundFrames(Struct, frozen=True):
    """What was found in the frames of a ring from ``first_frame`` to before ``stop_frame``; stays as it is.

    ``frames`` are the numbers of the telegrams, CAN frames and what protocols read, of the wanted list if one is;
    ``matches`` those of them that the filter chooses, all without one. Both rise. ``lists`` are the keys of the lists
    that frames belong to which the filter chooses, whatever list is wanted; ``is_whole``: those of all frames that a
    ring had at some time.
    """

    wanted: Wanted = EVERYTHING
    first_frame: int = 1
    stop_frame: int = 1
    frames: I64 = field(default_factory=_no_frames)
    matches: I64 = field(default_factory=_no_frames)
    lists: Collection[str] = ()
    is_whole: bool = False

    def behind(self, recent: Recent) -> int:
        """Return how many frames of a ring were not looked at yet."""
        return max(recent.stop_frame - max(self.stop_frame, recent.first_frame), 0)


class _Numbers:
    """Rising numbers that come at the end and go at the beginning; what was seen of them stays as it is."""

    def __init__(self) -> None:
        self._room = np.empty(1024, np.int64)
        self._start = self._stop = 0

    def add(self, numbers: I64) -> None:
        count, kept = len(numbers), self._stop - self._start
        if self._stop + count > len(self._room):
            # Somebody may still look at the old room.
            room = np.empty(max(2 * (kept + count), 1024), np.int64)
            room[:kept] = self.seen
            self._room, self._start, self._stop = room, 0, kept
        self._room[self._stop : self._stop + count] = numbers
        self._stop += count

    def drop(self, before: int) -> None:
        """Let go of the numbers below one."""
        self._start += int(np.searchsorted(self.seen, before))

    @property
    def seen(self) -> I64:
        return self._room[self._start : self._stop]


class RecentFrames:
    """Looks at the rings of scenes of one session, for the frames of one ``Wanted``.

    ``chosen`` is its filter, None without one: the frames that it chooses are those that ``nvscope packets -Y`` shows
    of the same frames.
    """

    def __init__(self, scene: Scene, wanted: Wanted = EVERYTHING, chosen: DisplayFilter | None = None) -> None:
        self.wanted = wanted
        reading = scene.inquiry.reading(chosen, all_frames=bool(chosen and chosen.of_others))
        self._start_ns = scene.recent.start_ns
        self._channels = scene.channels
        self._recogniser = recogniser_of(reading, scene.snapshot.infos, lambda: self._channels)
        self._first = self._stop = 0
        self._frames, self._matches = _Numbers(), _Numbers()
        self._lists: set[str] = set()
        self._read_ones: dict[str, ReadValues] = {}
        self._is_whole = False
        self.judged = bool(chosen and chosen.judged)
        """Its filter goes by what was known of the scene; in a later one it may choose otherwise."""
        self._varieties: Varieties | None = None
        self._keys: list[str] = []
        self._key_of = _no_frames()
        self._by_key: dict[str, int] = {}

    @staticmethod
    def of(scene: Scene, wanted: Wanted = EVERYTHING) -> RecentFrames:
        """Return what looks at a scene for what is wanted; UsageError where the filter cannot be understood."""
        chosen = None if wanted.expression is None else scene.filter(wanted.expression)
        return RecentFrames(scene, wanted, chosen)

    def fits(self, recent: Recent) -> bool:
        """Tell whether a ring can be gone on with, and holds no frames from before what was looked at."""
        return recent.start_ns == self._start_ns and (not self._stop or recent.first_frame >= self._first)

    def step(self, scene: Scene, most_frames: int = STEP_FRAMES) -> int:
        """Look at the next frames of a ring, the oldest first; return how many are left."""
        recent = scene.recent
        self._channels = scene.channels
        first = max(recent.first_frame, self._stop)
        self._first = recent.first_frame
        self._frames.drop(self._first)
        self._matches.drop(self._first)
        stop = min(first + most_frames, recent.stop_frame)
        for chunk in recent.pieces(first, stop):
            for told in told_of(self._recogniser, chunk, recent):
                self._take(told)
        self._stop = max(first, stop)
        left = max(recent.stop_frame - self._stop, 0)
        self._is_whole |= not left
        return left

    def found(self) -> FoundFrames:
        """Return what was found so far."""
        return FoundFrames(
            self.wanted,
            self._first,
            self._stop,
            self._frames.seen,
            self._matches.seen,
            frozenset(self._lists),
            self._is_whole,
        )

    def _take(self, told: Told) -> None:
        own = told.wanted
        chosen = None if told.chosen is None else told.chosen[own]
        key_of = self._keys_of(told)
        self._lists.update(self._named(key_of[told.variety[own if chosen is None else own[chosen]]]))
        if told.chosen is not None:
            self._take_read_ones(told, told.chosen)
        if self.wanted.list_key is not None:
            of_list: Bool = key_of[told.variety[own]] == self._by_key.get(self.wanted.list_key, len(self._keys))
            own, chosen = own[of_list], None if chosen is None else chosen[of_list]
        self._frames.add(own + told.first_frame)
        self._matches.add((own if chosen is None else own[chosen]) + told.first_frame)

    def _take_read_ones(self, told: Told, chosen: Bool) -> None:
        """Take what stands for lists of those frames of pages and databases that the filter chooses."""
        for source in SOURCES:
            part = told.parts.get(source.name)
            if part is not None:
                if source.name not in self._read_ones:
                    self._read_ones[source.name] = source.read(None)
                self._lists.update(self._read_ones[source.name].lists_of(part, chosen))

    def _named(self, places: I64) -> list[str]:
        count = np.bincount(places - _NO_PLACE, minlength=1)
        return [self._keys[place] for place in np.flatnonzero(count[1:]).tolist()]

    def _keys_of(self, told: Told) -> I64:
        """Return the place of the list of each variety among the keys, -1 where it is of none."""
        if told.varieties is not self._varieties:
            self._varieties, self._key_of = told.varieties, _no_frames()
        new = np.arange(len(self._key_of), len(told.varieties))
        if not len(new):
            return self._key_of
        carried = told.varieties.carried.take(new)
        place = np.full(len(new), _NO_PLACE)
        for row in np.flatnonzero(carried.of_list).tolist():
            carrier = Carrier(int(carried.carrier[row]))
            key = str(
                ListKey.of(carrier, int(carried.port[row]), int(carried.identifier[row]), told.pdos.channel)
            )  # fmt: skip
            place[row] = self._by_key.setdefault(key, len(self._keys))
            if place[row] == len(self._keys):
                self._keys.append(key)
        self._key_of = np.append(self._key_of, place)
        return self._key_of


def recogniser_of(
    reading: Reading, infos: Collection[SourceInfo], channels: Callable[[], Sequence[str]]
) -> Recogniser:  # fmt: skip
    """Return what recognises the frames of a ring one by one; ``channels`` are the names of CAN channels by then."""
    if not all(info.hears_answers for info in infos):
        reading = replace(reading, hears_answers=False)
    return Recogniser(reading, channels, by_stream=False)


def told_of(recogniser: Recogniser, chunk: Chunk, recent: Recent) -> list[Told]:
    """Return the frames of a ring recognised, each with its place in the capture."""
    recogniser.go_on_behind(Before(chunk.first_frame - 1, recent.start_ns, chunk.before_ns))
    return list(recogniser.tell(chunk.packets))
