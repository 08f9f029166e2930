"""The variables of network variables lists, as ``visu serve`` answers for them: with the values received last."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from msgspec import Struct, field

from dissectors.webvisu import UNREADABLE, Place
from nvscope.definition.element_names import folded
from nvscope.definition.layouts import Layouts
from nvscope.definition.packing import TelegramLayout
from nvscope.definition.sent_elements import SentElement, SentElements, typed
from nvscope.definition.variables import Element, Elementary
from nvscope.engine.told import Told
from nvscope.list_key import ListKey
from nvscope.plc.visu.element import element_text, visu_type
from nvscope.plc.visu.table import MOST_VARIABLES, Entry, ServedTable, ServedVariable
from nvscope.tracker.variables.data_telegrams import DataTelegrams, Stream
from nvscope.tracker.variables.moment import LastTelegram

_GLOBAL = 4
_ONLY_READ = ServedVariable(access="ro")

_Telegram = tuple[ListKey, int]
"""A list, by the key that it is defined for, and a SubIndex."""


class _Sent(Struct):
    """An element of a list, and the telegrams that have it: by several definitions it may be in one or another."""

    key: ListKey
    list_name: str
    name: str
    type: Elementary
    subindexes: list[int] = field(default_factory=list)


class ServedLists:
    """All variables of lists, each with a place of its own; an observer of the traffic in which their values come.

    ``table`` has the variables in the order of the definitions: called as in their list, behind its name where several
    lists have that name, behind its key where several have both. They are read only: what a list has is not the page's
    to change. ``lists`` is how many lists they are of, ``left_out`` how many variables more than ``MOST_VARIABLES``
    there are. A value is that of the last telegram that has the variable, whoever sent it; ``now`` says it, for any
    thread.
    """

    by_stream: ClassVar[bool] = True

    def __init__(self, layouts: Layouts) -> None:
        self._layouts = layouts
        self._read = DataTelegrams(lambda stream: layouts.key_of(stream.list) is not None)
        self._last: dict[_Telegram, LastTelegram] = {}
        self._spans: dict[_Telegram, tuple[TelegramLayout, Mapping[str, tuple[int, Element]]]] = {}
        found = _sent(layouts)
        self.left_out = max(len(found) - MOST_VARIABLES, 0)
        self._sent: dict[Place, _Sent] = {}
        entries, free = [], 0
        for one, name in zip(found[:MOST_VARIABLES], _names(found), strict=False):
            size, code = visu_type(one.type)
            place = Place(_GLOBAL, free, size, code)
            free += size
            self._sent[place] = one
            entries.append(Entry(name, place, UNREADABLE, _ONLY_READ))
        self.lists = len({one.key for one in self._sent.values()})
        self.table = ServedTable(entries=tuple(entries), stamp=_stamp(entries))

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for part in self._read.of(told):
            key = self._layouts.key_of(part.stream.list)
            if key is None or not len(part.frame):
                continue
            telegram, shape = (key, part.stream.subindex), (part.items, part.data.shape[1])
            known = self._last.get(telegram)
            frame = int(part.frame[-1])
            if known is not None and known.frame > frame:
                continue
            layout = self._layout(known, part.stream, shape)
            if layout is not None:
                # A value that is replaced as a whole: whoever reads has the one before it, or this one.
                self._last[telegram] = LastTelegram(
                    part.stream, layout, part.data[-1].copy(), frame, int(part.time_ns[-1])
                )

    def _layout(self, known: LastTelegram | None, stream: Stream, shape: tuple[int, int]) -> TelegramLayout | None:
        if known is not None and known.layout.shape == shape:
            return known.layout
        layout = self._layouts.telegram_of(stream.list, stream.subindex, shape)
        return layout if layout is not None and layout.shape == shape else None

    def now(self, place: Place) -> str | None:
        """Return the value that a variable has, as it goes onto the wire; None before the first telegram with it."""
        sent = self._sent.get(place)
        if sent is None:
            return None
        telegrams = [(sent.key, subindex) for subindex in sent.subindexes]
        came = [(last.frame, one, last) for one in telegrams if (last := self._last.get(one)) is not None]
        for _, telegram, last in sorted(came, key=lambda entry: -entry[0]):
            found = self._spans_of(telegram, last.layout).get(folded(sent.name))
            if found is not None:
                offset, element = found
                # Programs that differ may send one name as two types; the list of variables has the first one.
                if visu_type(element.type) != visu_type(sent.type):
                    return None
                return element_text(element.type, last.data[offset : offset + element.type.size_bytes].tobytes())
        return None

    def _spans_of(self, telegram: _Telegram, layout: TelegramLayout) -> Mapping[str, tuple[int, Element]]:
        known = self._spans.get(telegram)
        if known is None or known[0] is not layout:
            spans = {folded(element.name): (offset, element) for offset, element in layout.spans()}
            known = self._spans[telegram] = layout, spans
        return known[1]


def _sent(layouts: Layouts) -> list[_Sent]:
    """Return the elements of all lists, each name of a list once."""
    found: dict[tuple[ListKey, str], _Sent] = {}
    for telegram, _ in SentElements(layouts).telegrams():
        for one in telegram:
            known = found.setdefault((one.key, folded(one.element.name)), _new(one))
            if one.layout.subindex not in known.subindexes:
                known.subindexes.append(one.layout.subindex)
    return list(found.values())


def _new(one: SentElement) -> _Sent:
    return _Sent(one.key, one.layout.list.name, one.element.name, one.element.type)


def _names(found: Sequence[_Sent]) -> list[str]:
    """Return what variables are called, so that each name is there once as far as lists have names and keys."""
    names = [one.name for one in found]
    fronts: tuple[Callable[[_Sent], str], ...] = (lambda one: one.list_name, lambda one: str(one.key))
    for front in fronts:
        seen = Counter(name.casefold() for name in names)
        names = [
            f"{typed(front(one))}.{one.name}" if seen[name.casefold()] > 1 else name
            for one, name in zip(found, names, strict=True)
        ]
    return names


def _stamp(entries: Sequence[Entry]) -> str:
    """Return what the list says of its time: another one where something else lies somewhere."""
    rows = "\n".join(f"{one.name}={one.place.text}" for one in entries)
    return f"{zlib.crc32(rows.encode())},{len(entries)}"
