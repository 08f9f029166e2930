"""Telegrams as text for people: a line each, or a tree, with or without the bytes of the frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from dissectors.netvar import HEADER
from nvscope.report.ansi import paint
from nvscope.report.packets.hexdump import dump
from nvscope.report.packets.line import LineWriter, Moment
from nvscope.report.packets.tree import Trees
from nvscope.view.table import Line, Tone
from nvscope.view.telegrams import TelegramRows

if TYPE_CHECKING:
    from nvscope.definition.layouts import Layouts


class Text:
    """The text of pieces that follow each other, as a ``Face``.

    With ``trees`` a tree takes the place of the line. With ``dumps`` the captured bytes follow. ``width`` limits lines
    and trees, not dumps; None for no limit. ``layouts`` name the variables in trees, ``names`` the nodes in lines, by
    the text of their address. With and without ``colour`` the text is the same.
    """

    def __init__(
        self,
        *,
        trees: bool = False,
        dumps: bool = False,
        moment: Moment = "r",
        width: int | None = None,
        colour: bool = False,
        layouts: Layouts | None = None,
        names: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._layouts = layouts
        self._trees = trees
        self._dumps = dumps
        self._width = width
        self._colour = colour
        self._lines = LineWriter(moment, width, names)

    def begin(self) -> str:
        return ""

    def render(self, rows: TelegramRows) -> Iterator[str]:
        """Yield the text of a piece: at once where it is lines only, else of a telegram at a time."""
        if self._trees or self._dumps:
            yield from self._one_by_one(rows)
        elif self._colour:
            yield paint(self._lines.lines(rows), colour=True)
        else:
            yield "\n".join(self._lines.texts(rows)) + "\n"

    def end(self) -> str:
        return ""

    def _one_by_one(self, rows: TelegramRows) -> Iterator[str]:
        trees = Trees(rows, self._width, dumps=not self._dumps, layouts=self._layouts) if self._trees else None
        heads: Iterator[Line] = iter(()) if trees else self._lines.lines(rows)
        for row in range(len(rows)):
            text: list[Line] = []
            if trees:
                text += trees.lines(row)
                text += [[]] * self._dumps
            else:
                text.append(next(heads))
            if self._dumps:
                text += _dump(rows, row)
            text.append([])
            yield paint(text, colour=self._colour)


def _dump(rows: TelegramRows, row: int) -> Iterator[Line]:
    """Yield the captured bytes of a frame: what is in front of the telegram faint, its header strong."""
    datagram = rows.telegrams.datagram
    packet_row = int(datagram.row[row])
    payload_at = int(datagram.payload[row] - rows.packets.offset[packet_row])
    captured_bytes = int(datagram.captured_bytes[row])
    packet = rows.packets.packet(packet_row)
    parts = (
        (payload_at, Tone.FAINT),
        (payload_at + min(HEADER.size_bytes, captured_bytes), Tone.STRONG),
        (payload_at + captured_bytes, Tone.PLAIN),
        (len(packet), Tone.FAINT),
    )
    return dump(packet, parts)
