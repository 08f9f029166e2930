"""Finding: one thing that is wrong, or worth knowing, with its figures; and the events that it is made of."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from typing import TYPE_CHECKING

from msgspec import Struct

from nvscope.findings.kind import FindingKind
from nvscope.tracker.event_kinds import FRAMES_KEPT

if TYPE_CHECKING:  # `explain` reads the rows beside the judges, and starts without what these judge from
    from nvscope.findings.misfit import Misfit
    from nvscope.list_key import ListKey
    from nvscope.tracker.events import EventRows


class Finding(Struct, frozen=True):
    """A finding of one kind in one place; what it does not concern is None.

    ``list_number`` is a number of the state, ``node`` one of the summary. ``frames`` are the first ten of its events
    (of those whose frames are known), times those of its first and last.
    """

    kind: FindingKind
    message: str
    count: int
    first_ns: int | None
    last_ns: int | None
    frames: tuple[int, ...] = ()
    list_number: int | None = None
    node: int | None = None
    subindex: int | None = None
    hint: str = ""
    """What to check next, where the catalogue's first step does not fit the case."""
    key: ListKey | None = None
    """The list that it is about, where no frame of it was seen: then it has no number."""
    channel: str | None = None
    """The CAN channel that it is about, where it is about no one list of it."""
    parts: tuple[Finding, ...] = ()
    """Those that it stands for, in their order, where it is one finding for many lists."""
    extent: float | None = None
    """How far it goes, of kinds in ``nvscope.findings.badness.EXTENTS``."""
    variable: str = ""
    """What of another conversation it is about: ``sdo/192.168.1.20/0x2000:1``."""
    statuses: tuple[tuple[int, int], ...] = ()
    """HTTP statuses of replies that refused, and how often each came."""
    misfit: Misfit | None = None
    """How telegrams differ from the only definition of their list, where they do."""

    @property
    def code(self) -> str:
        """The code of its kind, as reports have it: ``NV201``."""
        return self.kind.code

    @property
    def place(self) -> Hashable:
        """What it is and where: the same of one look and the next, whatever its figures."""
        return self.code, self.list_number, self.node, self.subindex, self.key, self.channel, self.variable

    @property
    def lists(self) -> tuple[int, ...]:
        """The lists of which it says the same, by number, where it is one finding for many."""
        return tuple(dict.fromkeys(part.list_number for part in self.parts if part.list_number is not None))

    @property
    def frames_cut(self) -> int:
        """How many more frames there are behind those that are named; 0 where none is."""
        return max(self.count - len(self.frames), 0) if self.frames else 0


class Events(Struct, frozen=True):
    """Events of one kind and place, as logged by the tracker."""

    count: int
    first_ns: int
    last_ns: int
    frames: tuple[int, ...]

    def followed_by(self, later: Events) -> Events:
        """Return these events and others behind them."""
        frames = (self.frames + later.frames)[:FRAMES_KEPT]
        return Events(self.count + later.count, self.first_ns, later.last_ns, frames)

    def among(self, others: Events) -> Events:
        """Return these events and others that happened meanwhile."""
        frames = tuple(sorted(self.frames + others.frames)[:FRAMES_KEPT])
        first_ns, last_ns = min(self.first_ns, others.first_ns), max(self.last_ns, others.last_ns)
        return Events(self.count + others.count, first_ns, last_ns, frames)


def events_of(rows: EventRows, row: int) -> Events:
    """Return one row of an event log."""
    return _events(int(rows.count[row]), int(rows.first_ns[row]), int(rows.last_ns[row]), rows.frames[row].tolist())


def all_events(rows: EventRows) -> Iterator[Events]:
    """Yield all rows of an event log."""
    return map(_events, *(rows.column(name).tolist() for name in ("count", "first_ns", "last_ns", "frames")))


def _events(count: int, first_ns: int, last_ns: int, frames: Iterable[int]) -> Events:
    return Events(count, first_ns, last_ns, tuple(filter(None, frames)))
