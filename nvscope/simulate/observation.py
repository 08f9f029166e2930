"""Observation: what of a scenario somebody at the capture point can see.

Enough of a frame must be captured for it to count. Nothing is parsed: what a frame is follows from its template.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Callable
from functools import cached_property

import numpy as np

from dissectors.batch import I32, I64, U8, Bool
from dissectors.netvar import ACKNOWLEDGE_WANTED, HEADER
from nvscope.list_key import ListKey
from nvscope.simulate.faults import Label
from nvscope.simulate.frame_table import FrameTable
from nvscope.simulate.frames import IPAddress, address_order
from nvscope.simulate.ordering import order_by
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.template import Role, Template

LEAST_BYTES = 12


class Observation:
    """The frames of a scenario as seen, columns of shape (n,); ``end_ns`` is the end of the capture.

    ``telegram`` is true for what an observer recognises as one, ``judged`` for those whose header is captured,
    ``data`` for well-formed data telegrams among them. ``by_stream`` are the rows of ``data``, sorted by stream and
    then in the order of the capture; ``same_stream`` tells which of them follow one of their own stream.
    """

    def __init__(self, scenario: Scenario, table: FrameTable, end_ns: int) -> None:
        self.scenario = scenario
        self.table = table
        self.end_ns = end_ns
        self.templates = table.templates
        self.streams = table.streams
        self.addresses: list[IPAddress] = [ipaddress.ip_address(node.address) for node in scenario.node]
        payload, size, index_end = (
            self.fact(lambda entry: entry.frame.payload),
            self.fact(lambda entry: entry.frame.payload_bytes if entry.frame.payload >= 0 else 0),
            self.fact(lambda entry: entry.index_end),
        )
        captured = table.captured - payload
        self.role: U8 = self.fact(lambda entry: entry.role).astype(np.uint8)
        self.stream: I32 = self.fact(lambda entry: entry.stream)
        self.telegram: Bool = (self.role <= Role.PARAMETER) & (captured >= LEAST_BYTES)
        self.truncated: Bool = self.telegram & (captured < size)
        self.judged: Bool = self.telegram & (~self.truncated | (captured >= HEADER.size_bytes))
        self.data: Bool = self.judged & (self.role == Role.DATA)
        self.rejected: Bool = (self.role == Role.UNREACHABLE) & (index_end > 0) & (table.captured >= index_end)
        self.wants: Bool = (table.flags & ACKNOWLEDGE_WANTED.mask) != 0
        rows = np.flatnonzero(self.data)
        self.by_stream: I64 = rows[order_by(self.stream[rows])]
        sorted_stream = self.stream[self.by_stream]
        self.same_stream: Bool = np.zeros(len(rows), np.bool_)
        self.same_stream[1:] = sorted_stream[1:] == sorted_stream[:-1]
        self._starts = np.searchsorted(sorted_stream, np.arange(len(self.streams) + 1))
        self.repeated: Bool = np.zeros(len(table), np.bool_)
        self.repeated[self.by_stream] = self._repeated(captured)
        self.latest_after: I64 = np.append(np.maximum.accumulate(table.ts_ns[::-1])[::-1], -1)

    def fact(self, of: Callable[[Template], int]) -> I32:
        """Return for each frame what its template says."""
        facts: I32 = np.array([of(entry) for entry in self.templates] or [0], np.int32)[self.table.template]
        return facts

    def where(self, rows: I64, wanted: Callable[[Template], bool]) -> I64:
        """Return those of the rows whose template is wanted."""
        numbers = self.table.template[rows]
        chosen = np.zeros(len(self.templates) + 1, np.bool_)
        for number in np.flatnonzero(np.bincount(numbers, minlength=1)).tolist():
            chosen[number] = wanted(self.templates[number])
        found: I64 = rows[chosen[numbers]]
        return found

    def by_template(self, rows: I64) -> list[tuple[Template, int]]:
        """Return the templates of the rows, and how many rows have each."""
        counts = np.bincount(self.table.template[rows], minlength=1)
        return [(self.templates[number], int(counts[number])) for number in np.flatnonzero(counts).tolist()]

    def rows_of_stream(self, stream: int) -> I64:
        """Return the data telegrams of a stream in the order of the capture."""
        return self.by_stream[self._starts[stream] : self._starts[stream + 1]]

    @cached_property
    def rows_of_lists(self) -> dict[ListKey, I64]:
        """The rows of each list that is seen: its telegrams, and refusals that quote it."""
        keys = sorted({entry.key for entry in self.templates if entry.key is not None})
        number_of = {key: number for number, key in enumerate(keys)}
        number = self.fact(lambda entry: len(keys) if entry.key is None else number_of[entry.key])
        number[~(self.telegram | self.rejected)] = len(keys)
        order = order_by(number)
        cuts = np.searchsorted(number[order], np.arange(len(keys) + 1))
        parts = {key: order[cuts[place] : cuts[place + 1]] for place, key in enumerate(keys)}
        return {key: rows for key, rows in parts.items() if len(rows)}

    @cached_property
    def unstarted(self) -> Bool:
        """Data telegrams before the second counter value of their stream, its first one among them."""
        rows = self.by_stream
        changed = np.zeros(len(rows), np.int64)
        counter = self.table.counter[rows]
        changed[1:] = self.same_stream[1:] & (counter[1:] != counter[:-1])
        running = np.cumsum(changed)
        begins = np.flatnonzero(~self.same_stream)
        base = np.repeat(running[begins], np.diff(np.append(begins, len(rows))))
        unstarted = np.zeros(len(self.table), np.bool_)
        unstarted[rows] = running == base
        return unstarted

    @cached_property
    def in_order(self) -> I64:
        """The data telegrams that are neither copies nor overtaken, in the order of the capture."""
        return np.flatnonzero(self.data & (self.table.label == Label.IN_ORDER))

    @cached_property
    def subindex(self) -> I32:
        """The SubIndex of each frame, 0 where it is of no list."""
        return self.fact(lambda entry: entry.subindex)

    def timed(self, stream: int) -> I64:
        """Return the telegrams of a stream between which intervals are taken."""
        rows = self.rows_of_stream(stream)
        timed: I64 = rows[(self.table.label[rows] == Label.IN_ORDER) | self.unstarted[rows]]
        return timed

    def sources(self, rows: I64) -> list[IPAddress]:
        """Return who sent any of the rows, in the order of addresses."""
        return sorted({template.source for template, _ in self.by_template(rows)}, key=address_order)

    def streams_of_node(self, node: int) -> list[int]:
        """Return the streams of a node of which a data telegram is seen."""
        return self._streams_of_nodes.get(node, [])

    @cached_property
    def _streams_of_nodes(self) -> dict[int, list[int]]:
        found: dict[int, list[int]] = {}
        for number in np.flatnonzero(np.diff(self._starts)).tolist():
            found.setdefault(self.streams[number].node, []).append(number)
        return found

    def _repeated(self, captured: I32) -> Bool:
        """Return which data telegrams are, byte for byte, the one before them in their stream; ordered by stream."""
        rows, table = self.by_stream, self.table
        changes = self.fact(lambda entry: entry.frame.values is not None and entry.frame.changing_bytes > 0)[rows]
        content = np.where((changes != 0) & (captured[rows] > HEADER.size_bytes), table.ordinal[rows], 0)
        equal = self.same_stream.copy()
        equal[1:] &= content[1:] == content[:-1]
        for column in (table.template, table.counter, table.flags, table.checksum, table.captured):
            equal[1:] &= column[rows[1:]] == column[rows[:-1]]
        return equal
