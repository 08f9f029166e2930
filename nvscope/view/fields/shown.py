"""Which findings and causes telegrams show, and with which of these a display filter looks at each telegram.

A telegram shows what names its frame. What names no frame is shown by all telegrams of its lists: a finding by those of
its node and SubIndex, a cause by those of its nodes, as far as these send some.

Where an expression asks for findings, it is asked of a telegram once for each that it shows, and likewise for causes.
Where it asks for both, each finding is looked at together with the cause that explains it (that lists it) if the
telegram shows that one too, else without a cause; and each cause that explains none of the findings shown, without a
finding. So what is asked of one alone is answered alike whatever else is asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from nvscope.list_key import ListKey
from nvscope.view.fields.places import NodeKey, in_list, senders_and_lists
from nvscope.view.rows.frames import FrameRows

NONE = -1
"""The number of a finding or cause where there is none."""


class Lasting(Struct, frozen=True):
    """Something that names no frame: its number, and which telegrams show it.

    ``nodes`` are those whose telegrams do, by list; empty for all. ``subindex`` is None for any.
    """

    number: int
    nodes: Mapping[ListKey, frozenset[NodeKey]]
    subindex: int | None = None

    def shown_by(self, node: NodeKey, key: ListKey) -> bool:
        """Tell whether telegrams of a node and list show it."""
        nodes = self.nodes.get(key)
        return nodes is not None and (not nodes or node in nodes)


class Shown:
    """What telegrams show of findings, or of causes: ``frames`` are those that each names, by number."""

    def __init__(self, frames: Iterable[Sequence[int]], lasting: Sequence[Lasting]) -> None:
        pairs = sorted((frame, number) for number, some in enumerate(frames) for frame in some)
        self._frame = np.array([frame for frame, _ in pairs], np.int64)
        self._number = np.array([number for _, number in pairs], np.int64)
        self._lasting = lasting

    def by(self, rows: FrameRows) -> tuple[I64, I64]:
        """Return positions of telegrams, each as often as it shows something, and the numbers of that."""
        frame = rows.frame_number
        first = np.searchsorted(self._frame, frame)
        count = np.searchsorted(self._frame, frame, "right") - first
        position = np.repeat(np.arange(len(frame)), count)
        place = np.arange(len(position)) - np.repeat(np.cumsum(count) - count - first, count)
        positions, numbers = [position], [self._number[place]]
        if self._lasting:
            keys, code = senders_and_lists(rows)
            subindex = rows.carried.subindex
            for one in self._lasting:
                concerned = np.array([one.shown_by(*key) for key in keys], np.bool_)[code]
                if one.subindex is not None:
                    concerned &= subindex == one.subindex
                positions.append(np.flatnonzero(concerned & in_list(rows)))
                numbers.append(np.full(len(positions[-1]), one.number))
        return np.concatenate(positions), np.concatenate(numbers)


class Looks(NamedTuple):
    """Positions of telegrams, rising, each as often as it is looked at, and the numbers with which it is, or ``NONE``.

    Each telegram is there at least once.
    """

    position: I64
    finding: I64
    cause: I64


def looks(count: int, findings: tuple[I64, I64] | None, causes: tuple[I64, I64] | None, cause_of: I64) -> Looks:
    """Return how ``count`` telegrams are looked at that show some findings and causes; None: it is not asked for them.

    ``cause_of`` are the numbers of the causes that explain the findings.
    """
    nothing = np.zeros(0, np.int64)
    at, finding = findings or (nothing, nothing)
    cause_at, cause = causes or (nothing, nothing)
    found_cause = np.full(len(at), NONE)
    if findings and causes:
        # A telegram and a cause as one number, so that both sides can be held against each other at once.
        many = max(int(cause.max(initial=0)), int(cause_of.max(initial=0))) + 1
        explained = cause_of[finding]
        wanted, there = at * many + explained, cause_at * many + cause
        together = (explained != NONE) & np.isin(wanted, there)
        found_cause[together] = explained[together]
        alone = ~np.isin(there, wanted[together])
        cause_at, cause = cause_at[alone], cause[alone]
    without = np.ones(count, np.bool_)
    without[at] = without[cause_at] = False
    rest = np.flatnonzero(without)
    position = np.concatenate([at, cause_at, rest])
    order = np.argsort(position, kind="stable")
    unknown = np.full(len(rest), NONE)
    finding = np.concatenate([finding, np.full(len(cause), NONE), unknown])
    return Looks(position[order], finding[order], np.concatenate([found_cause, cause, unknown])[order])
