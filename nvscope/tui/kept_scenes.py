"""KeptScenes: the looks of a while, so that a person can go back in time; the older, the fewer."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from nvscope.analysis.watching import Scene
from nvscope.engine.ring import Recent
from nvscope.tracker.can.summary import CanListSummary
from nvscope.tracker.summary import ListSummary
from nvscope.tui.look import STRIP_NS
from nvscope.tui.table_view import LONGEST_STRIP

MOST_BYTES = 128 << 20
"""So much memory the kept ones take, about."""

_APART_NS = 1_000_000_000

# What the parts of a scene take, as measured: of each stream, list, cause, finding, bus, pair and transaction.
_STREAM_BYTES, _LIST_BYTES, _CAUSE_BYTES, _FINDING_BYTES, _BUS_BYTES = 1_000, 1_400, 1_300, 700, 40_000
_PAIR_BYTES, _TRANSACTION_BYTES = 1_500, 600
_BASE_BYTES = 20_000


class KeptScenes:
    """Scenes by time, a second apart at least, of about ``most_bytes`` together.

    Where there is no room for all, those go that are nearest to others for their age: of what was just now, every
    second is there, of what was an hour ago, some.
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._kept: list[Scene] = []
        self._sizes: list[int] = []

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def size_bytes(self) -> int:
        """How many bytes they take, about."""
        return sum(self._sizes)

    @property
    def times_ns(self) -> list[int]:
        """Their times, in the order in which they were kept."""
        return [scene.at_ns or 0 for scene in self._kept]

    @property
    def first_ns(self) -> int | None:
        """The time of the oldest one, None without any."""
        return self._kept[0].at_ns if self._kept else None

    def add(self, scene: Scene) -> None:
        """Keep a scene, where it is a second away from the last one that is kept."""
        at_ns = scene.at_ns
        # A clock that was set back is far away, too.
        if at_ns is None or (self._kept and abs(at_ns - (self._kept[-1].at_ns or 0)) < _APART_NS):
            return
        if _size_of(scene) > self._most_bytes:
            return
        kept = _outlined(scene)
        self._kept = [*self._kept, kept]
        self._sizes.append(_size_of(kept) + _marks_of(kept))
        while self.size_bytes > self._most_bytes:
            self._thin_out()

    def at(self, time_ns: int) -> Scene | None:
        """Return the scene of a time: the last one before it, or the first one behind it; None without any."""
        kept: Sequence[Scene] = self._kept  # another thread may add to it
        before = [scene for scene in kept if (scene.at_ns or 0) <= time_ns]
        return before[-1] if before else kept[0] if kept else None

    def _thin_out(self) -> None:
        """Drop the scene that is missed least."""
        times = self.times_ns
        now_ns = times[-1] + _APART_NS
        # Without it, so much time is told by the one before; of old times that matters less.
        missed = [
            abs(after - before) / max(abs(now_ns - at), 1)
            for before, at, after in zip(times, times[1:], times[2:], strict=False)
        ]
        place = missed.index(min(missed)) + 1 if missed else 0
        self._kept = [*self._kept[:place], *self._kept[place + 1 :]]
        del self._sizes[place]


def _outlined(scene: Scene) -> Scene:
    """Return a scene without what is told once for all, or is not shown of what is past.

    Frames are kept by the ring: many rings would be more than memory has.
    """
    chronicle, happened = scene.chronicle, scene.snapshot.happened
    if chronicle is None or happened is None:
        return replace(scene, recent=Recent())
    happened = replace(happened, chronicle=chronicle.last(STRIP_NS).outlined(LONGEST_STRIP))
    return replace(scene, recent=Recent(), snapshot=replace(scene.snapshot, happened=happened))


def _size_of(scene: Scene) -> int:
    """Return about how many bytes a scene takes, but for its frames and chronicle."""
    known, contacts = scene.snapshot, scene.contacts
    lists: Sequence[CanListSummary | ListSummary] = (*known.summary.lists, *known.summary.can.lists)
    values = sum(
        one.data.nbytes + one.changes.nbytes + one.changed_ns.nbytes
        for stream in scene.variables for one in stream.sequence
    ) + sum(seen.taken_bytes for seen in scene.read_ones.values())  # fmt: skip
    return (
        _BASE_BYTES
        + _LIST_BYTES * len(lists)
        + _STREAM_BYTES * sum(len(entry.streams) for entry in lists)
        + _CAUSE_BYTES * (len(known.happened.causes) if known.happened else 0)
        + _FINDING_BYTES * sum(max(len(finding.parts), 1) for finding in known.findings)
        + _BUS_BYTES * len(known.summary.can.buses)
        + sum(
            column.nbytes
            for columns in (contacts.flows, contacts.answers, contacts.unanswered, contacts.devices)
            for column in columns
        )
        + scene.pace.counts.nbytes
        + scene.transactions.pace.counts.nbytes
        + _PAIR_BYTES * len(scene.transactions.numbers)
        # Most of them are in the scenes around it, too.
        + _TRANSACTION_BYTES * len(scene.transactions)
        + values
    )


def _marks_of(scene: Scene) -> int:
    """Return how many bytes the columns of a chronicle take."""
    chronicle = scene.snapshot.happened.chronicle if scene.snapshot.happened else None
    return sum(column.nbytes for column in (*chronicle.marks, *chronicle.pauses)) if chronicle is not None else 0
