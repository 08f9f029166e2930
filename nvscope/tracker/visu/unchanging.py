"""Unchanging: the variables that pages asked for and that never changed, or never could be read.

Of those that no reply has a value for, nobody knows whether they can be read.

Most values change soon or never: what has changed is not looked at any more, and of the others texts are compared with
the first one, whole columns at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, Bool
from dissectors.webvisu import UNREADABLE, Request, read_reply
from nvscope.definition.visu_values import value_in
from nvscope.engine.runs import rows_by
from nvscope.tracker.visu.controllers import Controller, controller_of
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.readings import telling
from nvscope.tracker.visu.variables import PageVariables

_SEPARATOR = ord("|")
_WORD_BYTES = 8
_MOST_COMPARED = 64
"""Longer values are compared one by one."""

_FEW = 4
"""So many replies are read one by one."""

_UNREADABLE = UNREADABLE.encode()


class NeverChanged(Struct, frozen=True):
    """What pages asked one controller for without seeing a change.

    ``variables`` is how many they asked for. ``unchanged`` are those that were told twice at least, and always had the
    same value; ``unreadable`` those that the controller could never read; by their names, sorted.
    """

    server: str
    variables: int
    unchanged: Sequence[str]
    unreadable: Sequence[str]


class Unchanging:
    """What never changed so far.

    ``variables`` are those that were asked for. ``first`` are first values, as they came, by number; ``again`` had the
    same once more, ``changed`` another one. ``unreadable`` could not be read at some time.
    """

    def __init__(self) -> None:
        self.variables = PageVariables()
        self.changed: set[int] = set()
        self.again: set[int] = set()
        self.unreadable: set[int] = set()
        self.first: dict[int, bytes] = {}

    def observe(self, part: VisuBatch, most: int) -> None:
        """Take the messages of a batch, which follow those before; ``most`` variables are told apart."""
        messages = part.messages
        replies = telling(part)
        if not len(replies):
            return
        groups = []
        keys = [getattr(messages, name)[replies] for name in ("naming", "pair", "asked")]
        for (naming, pair, asked), rows in rows_by(keys):
            controller, request = controller_of(part.pairs, pair, part.namings[naming].apart), part.requests[asked]
            own: list[int] = self.variables.of(controller, request, naming, part.namings[naming], most).tolist()
            some = replies[rows]
            if not self._open(own):
                continue
            if request.writes or len(some) <= _FEW:
                self._read(part, request, own, some)
                continue
            usual = _usual(part, some, len(request.entries))
            self._read(part, request, own, some[~usual])
            some = some[usual]
            # What changes does so soon: a few replies tell most of it.
            few = np.arange(0, len(some), max(len(some) // _FEW, 1))
            self._read(part, request, own, some[few])
            groups.append((own, np.delete(some, few)))
        self._compare_all(part, groups)

    def _open(self, own: list[int]) -> list[int]:
        """Return the places of the variables that have not changed yet."""
        return [place for place, number in enumerate(own) if number >= 0 and number not in self.changed]

    def _compare_all(self, part: VisuBatch, groups: list[tuple[list[int], I64]]) -> None:
        groups = [(own, some) for own, some in groups if len(some) and self._open(own)]
        if not groups:
            return
        octets = np.frombuffer(part.data + bytes(_WORD_BYTES), np.uint8)
        bars = np.flatnonzero(octets == _SEPARATOR)
        for own, some in groups:
            if left := self._open(own):
                self._compare(part, own, np.array(left, np.int64), some, octets, bars)

    def summary(self) -> Sequence[NeverChanged]:
        """Return a row a controller, by address; of those alone of which there is something to say."""
        found: dict[Controller, tuple[list[str], list[str], list[int]]] = {}
        for number, variable in enumerate(self.variables.known):
            unchanged, unreadable, every = found.setdefault(variable.controller, ([], [], []))
            every.append(number)
            if number not in self.first:
                unreadable += [variable.name] if number in self.unreadable else []
            elif number not in self.changed and number in self.again:
                unchanged.append(variable.name)
        return [
            NeverChanged(one.address, len(every), sorted(unchanged), sorted(unreadable))
            for one, (unchanged, unreadable, every) in sorted(found.items(), key=lambda pair: pair[0].order)
            if unchanged or unreadable
        ]

    def _read(self, part: VisuBatch, request: Request, own: list[int], replies: I64) -> None:
        """Take the values of replies one by one."""
        messages = part.messages
        for row in replies.tolist():
            if request.writes:
                texts = [entry.value for entry in request.entries]
            else:
                texts = list(read_reply(request, part.data[int(messages.start[row]) : int(messages.stop[row])]).values)
            for number, text in zip(own, texts, strict=False):
                if text is not None and number >= 0 and number not in self.changed:
                    self._take(number, text.encode("latin-1", "replace"))
                elif text is None and number >= 0 and not request.writes:
                    self.unreadable.add(number)

    def _take(self, number: int, text: bytes) -> None:
        if number not in self.first:
            self.first[number] = text
            return
        self.again.add(number)
        first = self.first[number]
        if text == first:
            return
        kind = self.variables.known[number].kind
        before, now = (value_in(kind, one.decode("latin-1")) for one in (first, text))
        if now is None or before != now:
            self.changed.add(number)

    def _compare(self, part: VisuBatch, own: list[int], left: I64, replies: I64, octets: U8, bars: I64) -> None:
        """Compare columns of values with the first ones."""
        first_bar = np.searchsorted(bars, part.messages.start[replies])
        start = bars[first_bar[:, np.newaxis] + left] + 1
        stop = bars[first_bar[:, np.newaxis] + left + 1]
        wanted = [self.first.get(own[place], _UNREADABLE) for place in left.tolist()]
        size = np.array([len(one) for one in wanted], np.int64)
        differs = (stop - start != size).any(axis=0)
        differs |= size > _MOST_COMPARED
        words = np.ndarray((len(octets) - _WORD_BYTES + 1,), "<u8", octets, 0, (1,))
        for begin in range(0, int(size[~differs].max(initial=0)), _WORD_BYTES):
            column = np.flatnonzero(~differs & (size > begin))
            bytes_left = np.minimum(size[column] - begin, _WORD_BYTES)
            mask = (np.uint64(1) << (bytes_left * 8 % 64).astype(np.uint64)) - np.uint64(1)
            mask[bytes_left == _WORD_BYTES] = np.uint64(2**64 - 1)
            told = [int.from_bytes(wanted[at][begin : begin + _WORD_BYTES], "little") for at in column.tolist()]
            found = words[start[:, column] + begin] & mask
            differs[column] |= (found != np.array(told, np.uint64)).any(axis=0)
        same = [own[place] for place in left[~differs].tolist()]
        self.again.update(number for number in same if number in self.first)
        self.unreadable.update(number for number in same if number not in self.first)
        for at in np.flatnonzero(differs).tolist():
            number = own[int(left[at])]
            for begin, end in zip(start[:, at].tolist(), stop[:, at].tolist(), strict=True):
                if number in self.changed:
                    break
                if (text := part.data[begin:end]) != _UNREADABLE:
                    self._take(number, text)
                else:
                    self.unreadable.add(number)


def _usual(part: VisuBatch, replies: I64, entries: int) -> Bool:
    """Tell which replies have as many fields as were asked for, and a bar at each end."""
    messages, octets = part.messages, np.frombuffer(part.data, np.uint8)
    start, stop = messages.start[replies], messages.stop[replies]
    usual: Bool = (messages.fields[replies] == entries) & (stop - start > 1) & (entries > 0)
    usual &= (octets[np.maximum(start, 0)] == _SEPARATOR) & (octets[np.maximum(stop - 1, 0)] == _SEPARATOR)
    return usual
