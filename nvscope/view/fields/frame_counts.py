"""Figures as a frame counts by itself: ``list.lost`` is how many telegrams were lost before this one.

As a display filter reads it, ``list.lost`` is that of the whole capture; a trigger asks what has just happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from msgspec.structs import replace

from dissectors.batch import Bool
from nvscope.expression.typed_columns import Column, FieldType
from nvscope.expression.words import TableWords, Words
from nvscope.tracker.figures import BY_NAME, Of
from nvscope.tracker.frame_counts import LATE, STEPS, Parts, added_by
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.places import in_list, on_can, on_udp
from nvscope.view.rows.frames import FrameRows

_BELONGS: dict[Of, Callable[[FrameRows], Bool]] = {Of.LIST: in_list, Of.NODE: on_udp, Of.BUS: on_can}


class FrameCountFields(Words[TelegramField]):
    """Fields, of which those that a frame counts by itself are read from what ``parts`` returns."""

    def __init__(self, fields: Words[TelegramField], parts: Callable[[], Parts]) -> None:
        self._fields = fields
        self._own = TableWords(
            {
                name: _field(fields[name], figure, of, parts)
                for figure in STEPS for of in BY_NAME[figure].of
                if (name := f"{of.value}.{figure}") in fields
            }
        )  # fmt: skip

    @property
    def own(self) -> list[str]:
        """The names of those that a frame counts by itself."""
        return list(self._own)

    def spelled(self, text: str) -> str | None:
        return self._fields.spelled(text)

    def __getitem__(self, name: str) -> TelegramField:
        return self._own[name] if name in self._own else self._fields[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)


def _field(field: TelegramField, figure: str, of: Of, parts: Callable[[], Parts]) -> TelegramField:
    def read(rows: FrameRows) -> Column:
        return added_by(parts(), figure, rows.frame_number)

    return replace(
        field, type=FieldType.SIGNED, read=read, known=_BELONGS[of], constant=False, judged=False,
        help=f"{field.help}; by this frame alone", texts=(), counts=True,
    )  # fmt: skip


def is_late(name: str) -> bool:
    """Tell whether a figure is told of frames that waited in vain, when their time is over."""
    figure = name.partition(".")[2]
    return any(step.kind in LATE for step in STEPS.get(figure, ()))
