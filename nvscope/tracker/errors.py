"""Error events: the last one of every list and of every node on a list, and how many a node has."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, Bool
from dissectors.keys import KeyTable
from nvscope.engine.dealing import Share
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.tracker.diagnosis import ERROR_ORDER, DiagError


class LastError(KeyedColumns):
    """One row a list or a member (list, node): the number of errors, and the last one.

    The last error is the one with the latest time. At equal times, deadlines come before what a frame itself says
    (``own``), then frames in their order, then errors in the order of ``ERROR_ORDER``, whose place is ``error``.
    """

    count: I64
    error: I64
    time_ns: I64
    own: I64
    frame: I64
    COLUMNS: ClassVar = {name: (np.int64(0), 1) for name in ("count", "error", "time_ns", "own", "frame")}


class ErrorEvents(Struct, frozen=True):
    """Some error events of one kind; ``node`` is -1 where nobody is to blame. Shapes (n,)."""

    error: DiagError
    own: bool
    list: I64
    node: I64
    time_ns: I64
    frame: I64


class Errors:
    """The errors of all lists, and of all members, which are numbered by ``members`` (list, node)."""

    def __init__(self) -> None:
        self.members = KeyTable()
        self.of_list = LastError()
        self.of_member = LastError()

    def observe(self, batch: list[ErrorEvents], lists: int) -> None:
        """Book the error events of a batch, in any order."""
        self.of_list.resize(lists)
        batch = [events for events in batch if len(events.list)]
        if not batch:
            return
        number = np.concatenate([events.list for events in batch])
        node = np.concatenate([events.node for events in batch])
        length = [len(events.list) for events in batch]
        error = np.repeat([ERROR_ORDER.index(events.error) for events in batch], length)
        own = np.repeat([int(events.own) for events in batch], length)
        time_ns = np.concatenate([events.time_ns for events in batch])
        frame = np.concatenate([events.frame for events in batch])
        _book(self.of_list, number, time_ns, own, frame, error)
        blamed = node >= 0
        member = self.members.numbers(number[blamed].astype(np.uint64), node[blamed].astype(np.uint64))
        self.of_member.resize(len(self.members))
        _book(self.of_member, member, time_ns[blamed], own[blamed], frame[blamed], error[blamed])

    def take(self, part: Errors, share: Share) -> None:
        """Take over the errors of a part's share of the lists."""
        self.of_list.take(part.of_list, share.lists)
        self.of_member.take_keyed(self.members, part.of_member, part.members.words)


def _book(table: LastError, number: I64, time_ns: I64, own: I64, frame: I64, error: I64) -> None:
    if not len(number):
        return
    np.add.at(table.count, number, 1)
    order = np.lexsort((error, frame, own, time_ns, number))
    number = number[order]
    ends = np.append(np.flatnonzero(number[1:] != number[:-1]), len(number) - 1)
    row, last = number[ends], order[ends]
    known = table.error[row] > 0
    later = ~known | _later(
        (time_ns[last], own[last], frame[last], error[last]),
        (table.time_ns[row], table.own[row], table.frame[row], table.error[row]),
    )
    row, last = row[later], last[later]
    table.time_ns[row], table.own[row] = time_ns[last], own[last]
    table.frame[row], table.error[row] = frame[last], error[last]


def _later(new: tuple[I64, ...], old: tuple[I64, ...]) -> Bool:
    """Compare keys of several columns: is the new one greater?"""
    greater = np.zeros(len(new[0]), np.bool_)
    equal = np.ones(len(new[0]), np.bool_)
    for left, right in zip(new, old, strict=True):
        greater |= equal & (left > right)
        equal &= left == right
    return greater
