"""GoingOn: which nodes go on with a cyclic list while another one is silent, as columns over all their streams."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dissectors.batch import I64
from nvscope.engine.runs import distinct, rows_by
from nvscope.findings.timing import STOPPED

if TYPE_CHECKING:  # a case has one of these
    from nvscope.causes.case import Case

_NOTHING = np.empty(0, np.int64)
_FOR_EVER = np.iinfo(np.int64).max


class GoingOn:
    """All cyclic streams of a case with their pauses, looked up once: very many nodes may be silent."""

    def __init__(self, case: Case) -> None:
        self._lists_of: dict[int, tuple[I64, I64]] = {}
        self._case = case
        streams: list[tuple[int, int, int]] = []
        pauses: list[tuple[int, int, int]] = []
        for node, own in case.streams_of_node.items():
            for one in own:
                if not one.nominal_ns:
                    continue
                for pause in case.pauses(one.list.number, one.stream):
                    until_ns = _FOR_EVER if pause.until_ns is None else pause.until_ns
                    pauses.append((len(streams), pause.since_ns, until_ns))
                streams.append((node, one.stream.first_ns, one.stream.last_ns))
        self._node, self._first_ns, self._last_ns = np.array(streams, np.int64).reshape(-1, 3).T
        self._stream, self._since_ns, self._until_ns = np.array(pauses, np.int64).reshape(-1, 3).T

    def beside(self, node: int, since_ns: int, until_ns: int | None, end_ns: int) -> int:
        """Return how many other nodes send a cyclic list as usual from one time to another; None has no end.

        ``end_ns`` is the end of the capture.
        """
        stop_ns = end_ns if until_ns is None else until_ns
        going = (self._node != node) & (self._first_ns < stop_ns) & (self._last_ns > since_ns)
        paused = self._until_ns > since_ns
        if until_ns is not None:
            paused &= self._since_ns < until_ns
        going[self._stream[paused]] = False
        return len(distinct(self._node[going]))

    def lists_behind(self, node: int, time_ns: int) -> list[int]:
        """Return the numbers of the lists that a node sent something of behind a time, cyclic or not."""
        if node not in self._lists_of:
            own = self._case.streams_of_node[node]
            lists, last_ns = ([one.list.number for one in own], [one.stream.last_ns for one in own])
            self._lists_of[node] = np.array(lists), np.array(last_ns)
        numbers_of, last_of_ns = self._lists_of[node]
        numbers: list[int] = distinct(numbers_of[last_of_ns > time_ns]).tolist()
        return numbers

    def lists_ended_by(self, node: int, time_ns: int) -> set[int]:
        """Return the numbers of the lists of a node that stopped up to a time, and did not come again."""
        numbers, ended_ns = self._ended.get(node, (_NOTHING, _NOTHING))
        return {*numbers[ended_ns <= time_ns].tolist()}

    @cached_property
    def _ended(self) -> Mapping[int, tuple[I64, I64]]:
        symptoms = self._case.symptoms
        rows = np.flatnonzero(symptoms.of_kinds(STOPPED))
        by_node = ((node, rows[own]) for (node,), own in rows_by((symptoms.node[rows],)))
        return {node: (symptoms.list[own], symptoms.time_ns[own]) for node, own in by_node}
