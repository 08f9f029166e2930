"""Fields of messages of which a frame may have several: ``visu.kind`` of each, at most ``MOST_MESSAGES`` times."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from nvscope.expression.column_rows import identities
from nvscope.expression.typed_columns import Column, FieldType
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.view.fields.field import TelegramField

MOST_MESSAGES = 64
"""A frame has a field so many times; where more messages have it, equal values count once, so that none is hidden."""

ReadMessages = Callable[[VisuBatch, I64], Column]
"""Gives the values of some messages of a part."""

KnowMessages = Callable[[VisuBatch, I64], Bool]
"""Tells which of some messages of a part have a value."""


class _Places:
    """Which message of each frame has a field, as the first, the second and so on; those of the last part are kept."""

    def __init__(self, read: ReadMessages, known: KnowMessages | None, *, once: bool) -> None:
        self._read, self._known, self._once = read, known, once
        # Always set as one: threads that look at different parts do not mix them up.
        self._last: tuple[VisuBatch, I64] | None = None

    def messages(self, part: VisuBatch, place: int) -> I64:
        """Return the message at a place of each frame, -1 where there is none."""
        last = self._last
        if last is None or last[0] is not part:
            last = self._last = (part, self._table(part))
        table = last[1]
        found: I64 = table[place] if place < len(table) else np.full(len(part), -1)
        return found

    def _table(self, part: VisuBatch) -> I64:
        frame, message = messages_of_frames(part)
        if self._known is not None:
            known = self._known(part, message)
            frame, message = frame[known], message[known]
        counted = np.bincount(frame, minlength=len(part))
        if self._once or counted.max(initial=0) > MOST_MESSAGES:
            new = _is_new(frame, identities(self._read(part, message)))
            if not self._once:
                new |= counted[frame] <= MOST_MESSAGES
            frame, message = frame[new], message[new]
        place = _places(frame)
        room = place < MOST_MESSAGES
        table = np.full((int(place[room].max(initial=-1)) + 1, len(part)), -1)
        table[place[room], frame[room]] = message[room]
        return table


def messages_of_frames(part: VisuBatch) -> tuple[I64, I64]:
    """Return all messages of the frames of a part in their order, and in front of them which frame each is of."""
    frame = np.repeat(np.arange(len(part)), part.count)
    return frame, part.first[frame] + _places(frame)


def _places(frame: I64) -> I64:
    """Return which of its frame each of some messages is, from 0 on."""
    at: I64 = np.arange(len(frame)) - np.searchsorted(frame, frame)
    return at


def _is_new(frame: I64, value: I64) -> Bool:
    """Tell which messages are the first ones of their frames with their values."""
    order = np.lexsort((value, frame))
    new = np.zeros(len(frame), np.bool_)
    new[order] = (np.diff(frame[order], prepend=-1) != 0) | (np.diff(value[order], prepend=0) != 0)
    return new


def message_field(
    name: str, kind: FieldType, label: str, text: str, read: ReadMessages, known: KnowMessages | None = None, *,
    of: str, texts: Sequence[str] = (), once: bool = False,
) -> TelegramField:  # fmt: skip
    """Return a field that a frame has for each of its messages; ``once``: for each of its different values."""
    places = _Places(read, known, once=once)

    def reader(place: int) -> Callable[[VisuBatch], Column]:
        return lambda part: read(part, np.maximum(places.messages(part, place), 0))

    def knows(place: int) -> Callable[[VisuBatch], Bool]:
        return lambda part: places.messages(part, place) >= 0

    first, *further = (
        TelegramField(name, kind, label, text, reader(place), knows(place), of=of, texts=texts)
        for place in range(MOST_MESSAGES)
    )
    return replace(first, further=tuple(further))
