"""Unchanging: the variables that pages asked for and that never changed, or never could be read.

Most values change soon or never: what has changed is not looked at any more, and of the others texts are compared with
the first one, whole columns at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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


@dataclass(frozen=True, slots=True)
class NeverChanged:
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

    ``variables`` are those that were asked for; ``asked`` is how often, by number, ``changed`` those that changed.
    ``first`` are first values, as they came; variables without one could never be read.
    """

    def __init__(self) -> None:
        self.variables = PageVariables()
        self.asked: I64 = np.zeros(0, np.int64)
        self.changed: set[int] = set()
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
            controller, request = controller_of(part.pairs, pair), part.requests[asked]
            own = self._numbers(controller, request, naming, part, most, len(rows))
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
            self._read(part, request, own, some[:: max(len(some) // _FEW, 1)])
            groups.append((own, some))
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
                unreadable.append(variable.name)
            elif number not in self.changed and self.asked[number] > 1:
                unchanged.append(variable.name)
        return [
            NeverChanged(one.address, len(every), sorted(unchanged), sorted(unreadable))
            for one, (unchanged, unreadable, every) in sorted(found.items(), key=lambda pair: pair[0].order)
            if unchanged or unreadable
        ]

    def _numbers(
        self, controller: Controller, request: Request, naming: int, part: VisuBatch, most: int, count: int
    ) -> list[int]:  # fmt: skip
        """Return the numbers of the variables of a request that was answered so often."""
        numbers = self.variables.of(controller, request, naming, part.namings[naming], most)
        if len(self.asked) < len(self.variables):
            self.asked = np.append(self.asked, np.zeros(len(self.variables), np.int64))
        np.add.at(self.asked, numbers[numbers >= 0], count)
        own: list[int] = numbers.tolist()
        return own

    def _read(self, part: VisuBatch, request: Request, own: list[int], replies: I64) -> None:
        """Take the values of replies one by one."""
        messages = part.messages
        for row in replies.tolist():
            if request.writes:
                texts = [entry.value for entry in request.entries]
            else:
                texts = list(read_reply(request, part.data[int(messages.start[row]) : int(messages.stop[row])]).values)
            for number, text in zip(own, texts, strict=False):
                if number >= 0 and number not in self.changed and text is not None:
                    self._take(number, text.encode("latin-1", "replace"))

    def _take(self, number: int, text: bytes) -> None:
        first = self.first.setdefault(number, text)
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
        for at in np.flatnonzero(differs).tolist():
            number = own[int(left[at])]
            for begin, end in zip(start[:, at].tolist(), stop[:, at].tolist(), strict=True):
                if number in self.changed:
                    break
                if (text := part.data[begin:end]) != _UNREADABLE:
                    self._take(number, text)


def _usual(part: VisuBatch, replies: I64, entries: int) -> Bool:
    """Tell which replies have as many fields as were asked for, and a bar at each end."""
    messages, octets = part.messages, np.frombuffer(part.data, np.uint8)
    start, stop = messages.start[replies], messages.stop[replies]
    usual: Bool = (messages.fields[replies] == entries) & (stop - start > 1) & (entries > 0)
    usual &= (octets[np.maximum(start, 0)] == _SEPARATOR) & (octets[np.maximum(stop - 1, 0)] == _SEPARATOR)
    return usual
