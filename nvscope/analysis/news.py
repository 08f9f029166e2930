"""News: which causes are there that were not, and which are over, from one look to the next."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Hashable, Iterable, Sequence

from msgspec import Struct

from nvscope.causes.cause import Cause

_MOST_OVER = 10_000
"""So many that are over are known again; of older ones hardly any comes back."""


class Told(Struct, frozen=True):
    """What changed between two looks: causes that are new, or there again, and those that are over.

    ``instead`` has, for each of ``ended``, the cause that its findings belong to now; None where it is over by itself,
    or they belong to none any more.
    """

    new: Sequence[Cause] = ()
    ended: Sequence[Cause] = ()
    instead: Sequence[Cause | None] = ()

    def __bool__(self) -> bool:
        return bool(self.new or self.ended)


class News:
    """Compares the causes of each look with those of the one before.

    A cause is the same as long as kind, place and beginning are, whatever its figures; one that goes on also where it
    is seen to begin at another time, as when what it began with was long ago, and is not kept. One that is over when it
    is seen first is told as both. A cause that is told no more is over: what followed has shown that it was none, or
    another one; then it has no ``until_ns``. What is over and was told so is not told again, be it that other lists
    turn out to be concerned, or that it was another cause's for a while.
    """

    def __init__(self) -> None:
        self._known: dict[Hashable, Cause] = {}
        self._over: dict[Hashable, list[Cause]] = defaultdict(list)
        self._order: deque[Hashable] = deque()

    def of(self, causes: Sequence[Cause]) -> Told:
        """Return what is new in the causes of a look."""
        now: dict[Hashable, Cause] = {}
        for cause in causes:
            now.setdefault(identity_of(cause), cause)
        gone: dict[Hashable, list[Cause]] = defaultdict(list)
        for identity, cause in self._known.items():
            if identity not in now and cause.until_ns is None:
                gone[_place(cause)].append(cause)
        new, ended = [], []
        for identity, cause in now.items():
            before = self._known.get(identity)
            is_over = cause.until_ns is not None
            if before is None and not is_over and gone[_place(cause)]:
                before = gone[_place(cause)].pop(0)
            before = before or _taken(gone, cause)
            if is_over and before is None and self._was_told(cause):
                continue
            if before is None or (before.until_ns is not None and not is_over):
                new.append(cause)
            if is_over and (before is None or before.until_ns is None):
                ended.append(cause)
                self._keep(cause)
        instead: list[Cause | None] = [None] * len(ended)
        for one in (cause for causes in gone.values() for cause in causes):
            ended.append(one)
            instead.append(_heir(one, now.values(), new))
        self._known = now
        return Told(tuple(new), tuple(ended), tuple(instead))

    def _was_told(self, cause: Cause) -> bool:
        """Tell whether it was told before that something is over which this cause is as well."""
        places = {*cause.nodes, *cause.lists}
        return any(places & {*one.nodes, *one.lists} or not places for one in self._over.get(_moment(cause), ()))

    def _keep(self, cause: Cause) -> None:
        self._over[_moment(cause)].append(cause)
        self._order.append(_moment(cause))
        if len(self._order) > _MOST_OVER:
            self._over.pop(self._order.popleft(), None)


def _moment(cause: Cause) -> Hashable:
    """Return what a cause is and when it began, wherever that was."""
    return cause.kind.name, cause.since_ns, cause.channel


def _heir(gone: Cause, causes: Iterable[Cause], new: Sequence[Cause]) -> Cause | None:
    """Return which cause explains what another one did: by findings, else a new one of the same node or list."""
    own = _findings_of(gone)
    known = [(len(own & _findings_of(one)), one) for one in causes]
    shared, heir = max(known, key=lambda pair: pair[0], default=(0, None))
    if shared:
        return heir
    places = {*gone.nodes, *gone.lists}
    return next((one for one in new if places & {*one.nodes, *one.lists}), None)


def is_over(cause: Cause, heir: Cause | None) -> bool:
    """Tell of one that ended, with its ``instead``, whether it is over, and not just told no more.

    Behind a state that no event told is nothing that could be another's: it is over when it is told no more.
    """
    return cause.until_ns is not None or not (cause.findings or heir)


def _findings_of(cause: Cause) -> set[Hashable]:
    return {one.place for one in cause.findings}


def _taken(gone: dict[Hashable, list[Cause]], cause: Cause) -> Cause | None:
    """Take the one that a cause was when other lists were known to be concerned, None where there is none."""
    for causes in gone.values():
        for one in causes:
            lists = {*one.lists}, {*cause.lists}
            alike = one.kind is cause.kind and one.since_ns == cause.since_ns and one.channel == cause.channel
            if alike and not one.nodes and not cause.nodes and (lists[0] <= lists[1] or lists[1] <= lists[0]):
                causes.remove(one)
                return one
    return None


def _place(cause: Cause) -> Hashable:
    """Return what a cause is and where: where it has nodes, lists may join it."""
    return cause.kind.name, cause.nodes or cause.lists or cause.channel


def identity_of(cause: Cause) -> Hashable:
    """Return what stays of a cause while it goes on."""
    return _place(cause), cause.since_ns
