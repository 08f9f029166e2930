"""Hops: the same variable in several lists, and how it travels from one to the other.

A gateway takes a variable from one list and sends it in another one, over the same bus or another. Where several lists
have a variable of one name and type, each two of them are a pair. A *change* is a value that is not that of the
telegram before; it *follows* a change of the other side to the same value, the latest one before it. From that come the
delay, the changes to values that the other side never had, and for how long both differed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from hashlib import blake2b
from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, U8, U64
from nvscope.definition.layouts import Layouts
from nvscope.definition.variables import Element, type_text
from nvscope.engine.told import Told
from nvscope.engine.watch import Unheard
from nvscope.list_key import ANY_CHANNEL, ListKey
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream, Telegrams, joined
from nvscope.tracker.variables.following import Pair, Side, add_rest, compare, remember
from nvscope.tracker.variables.values import Block, Table

MOST_ENDS = 8
"""In so many places a variable is compared; of one that is sent in more, the first ones."""

Name = tuple[str, str]
"""Name of a variable in lower case, and its type."""


class End(Side):
    """A variable in one stream: its last value, as bytes, and the changes that are remembered."""

    stream: Stream
    element: Element
    last: bytes = b""


class _Wanted(NamedTuple):
    """An element that several lists have, and where it is in the data of a telegram."""

    offset: int
    element: Element
    name: Name


class Hops:
    """The variables that several lists have, compared as batches come; however these are cut, it is the same.

    ``pairs`` are by variable, in the order in which its ends appeared. ``untyped`` are names that several lists have
    with different types: these are not compared.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, layouts: Layouts) -> None:
        self._layouts = layouts
        self._shared, self.untyped = _shared(layouts)
        self._read = DataTelegrams(self._may_share)
        self._ends: dict[Name, dict[tuple[int, int], End]] = defaultdict(dict)
        self._wanted: dict[tuple[int, int, int], tuple[_Wanted, ...]] = {}
        self.pairs: dict[Name, list[Pair[End]]] = defaultdict(list)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not self._shared:
            return
        for unheard in told.unheard:
            self._resume(unheard)
        changed: set[Name] = set()
        fresh: dict[int, tuple[I64, U64]] = {}
        for telegrams in joined(self._read.of(told)):
            self._take(telegrams, changed, fresh)
        for name in changed:
            for pair in self.pairs.get(name, ()):
                compare(pair, fresh)
            for end in self._ends[name].values():
                remember(end, fresh.get(id(end)))

    def _resume(self, unheard: Unheard) -> None:
        """Leave the unheard as it is: others may follow it, until it comes again or nobody listens to anything."""
        streams = set(unheard.streams.tolist())
        for pairs in self.pairs.values():
            for pair in pairs:
                if {pair.first.stream.number, pair.second.stream.number} & streams:
                    add_rest(pair, unheard.until_ns)
                    pair.until_ns = None
        for ends in self._ends.values():
            for end in ends.values():
                if unheard.everything:
                    end.forget()
                elif end.stream.number in streams and end.until_ns is None:
                    end.until_ns = unheard.until_ns

    def _may_share(self, stream: Stream) -> bool:
        return self._layouts.list_of(stream.list) is not None

    def _take(self, telegrams: Telegrams, changed: set[Name], fresh: dict[int, tuple[I64, U64]]) -> None:
        """Find the changes in telegrams of one stream."""
        stream = telegrams.stream
        for offset, element, name in self._wanted_of(telegrams):
            end = self._end(name, stream, element)
            if end is None:
                continue
            block = Block(0, 1, offset, element.type)
            cells = block.cells_of(telegrams.data).reshape(len(telegrams.frame), -1)
            raw = np.ascontiguousarray(cells).view(np.uint8).reshape(len(cells), -1)
            if end.until_ns is not None:
                end.forget()
            differs = np.ones(len(raw), np.bool_)
            differs[1:] = (raw[1:] != raw[:-1]).any(axis=1)
            differs[0] = end.since_ns is None or raw[0].tobytes() != end.last
            if end.since_ns is None:
                end.since_ns = int(telegrams.time_ns[0])
            end.telegrams += len(raw)
            end.last = raw[-1].tobytes()
            row = np.flatnonzero(differs)
            if not len(row):
                continue
            values = _numbers(cells, raw, row)
            times = telegrams.time_ns[row]
            if id(end) in fresh:
                before = fresh[id(end)]
                times, values = np.concatenate([before[0], times]), np.concatenate([before[1], values])
                order = np.argsort(times, kind="stable")
                times, values = times[order], values[order]
            fresh[id(end)] = times, values
            changed.add(name)

    def _wanted_of(self, telegrams: Telegrams) -> tuple[_Wanted, ...]:
        """Return the elements that other lists have too, of telegrams of one stream and shape."""
        stream, size_bytes = telegrams.stream, telegrams.data.shape[1]
        key = stream.number, telegrams.items, size_bytes
        if key not in self._wanted:
            shape = telegrams.items, size_bytes
            layout = self._layouts.telegram_of(stream.list, stream.subindex, shape)
            fits = layout is not None and shape == layout.shape
            spans = layout.spans() if layout is not None and fits else ()
            told = (_Wanted(offset, element, _name(element)) for offset, element in spans)
            self._wanted[key] = tuple(one for one in told if one.name in self._shared)
        return self._wanted[key]

    def _end(self, name: Name, stream: Stream, element: Element) -> End | None:
        ends = self._ends[name]
        key = stream.number, stream.subindex
        end = ends.get(key)
        if end is None and len(ends) < MOST_ENDS:
            end = End(stream, element)
            for other in ends.values():
                # Two senders of one list are no hop.
                if other.stream.list != stream.list:
                    self.pairs[name].append(Pair(other, end))
            ends[key] = end
        return end


def _shared(layouts: Layouts) -> tuple[set[Name], list[str]]:
    """Return the variables that several lists have, and the names of those whose types differ."""
    lists: dict[Name, set[ListKey]] = defaultdict(set)
    types: dict[str, dict[ListKey, str]] = defaultdict(dict)
    for key, _ in layouts.lists():
        for telegrams in layouts.candidates_of(key):
            for layout in telegrams:
                for element in layout.elements:
                    name = _name(element)
                    lists[name].add(key)
                    types[name[0]].setdefault(key, name[1])
    shared = {name for name, keys in lists.items() if len(keys) > 1 or _on_any_channel(keys)}
    return shared, [name for name, known in types.items() if len(set(known.values())) > 1]


def _on_any_channel(keys: set[ListKey]) -> bool:
    """Tell whether a list may be on several channels."""
    return any(key.port == ANY_CHANNEL for key in keys)


def _name(element: Element) -> Name:
    return element.name.replace(" ", "").lower(), type_text(element.type)


def _numbers(cells: Table, raw: U8, row: I64) -> U64:
    """Return 64 bits for each value of some rows: itself, or of a longer one a digest."""
    if cells.shape[1] == 1 and cells.dtype.kind == "u":
        words: U64 = cells[row, 0].astype(np.uint64)
        return words
    digests = (blake2b(raw[one].tobytes(), digest_size=8).digest() for one in row.tolist())
    return np.frombuffer(b"".join(digests), np.uint64)


def ordered(pairs: dict[Name, list[Pair[End]]]) -> Sequence[tuple[Name, Pair[End]]]:
    """Return all pairs by the name of their variable."""
    return [(name, pair) for name in sorted(pairs) for pair in pairs[name]]
