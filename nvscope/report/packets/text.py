"""Telegrams as text for people: a line each, or a tree, with or without the bytes of the frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from dissectors.can.frame import FRAME
from dissectors.netvar import HEADER
from nvscope.report.ansi import paint
from nvscope.view.lines.can_line import CanLineWriter
from nvscope.view.lines.hexdump import dump
from nvscope.view.lines.line import LineWriter
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.table import Line, Tone
from nvscope.view.lines.tree import Trees
from nvscope.view.rows.frames import TelegramRows

if TYPE_CHECKING:
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.pdos import Pdos


class Text:
    """The text of pieces that follow each other, as a ``Face``.

    With ``trees`` a tree takes the place of the line. With ``dumps`` the captured bytes follow. ``width`` limits lines
    and trees, not dumps; None for no limit. ``layouts`` name the variables in trees, ``names`` the nodes in lines, by
    the text of their address, ``pdos`` the lists on CAN. With and without ``colour`` the text is the same.
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
        pdos: Pdos | None = None,
    ) -> None:
        self._layouts = layouts
        self._trees = trees
        self._dumps = dumps
        self._width = width
        self._colour = colour
        self._pdos = pdos
        self._lines = LineWriter(moment, width, names)
        self._can_lines = CanLineWriter(moment, width, pdos)

    def begin(self) -> str:
        return ""

    def render(self, rows: TelegramRows) -> Iterator[str]:
        """Yield the text of a piece: at once where it is lines only, else of a telegram at a time."""
        if self._trees or self._dumps:
            yield from self._one_by_one(rows)
        elif self._colour or rows.can is not None:
            yield paint(self._lines_of(rows), colour=self._colour)
        else:
            yield "\n".join(self._lines.texts(rows)) + "\n"

    def end(self) -> str:
        return ""

    def _lines_of(self, rows: TelegramRows) -> Iterator[Line]:
        """Yield the lines of telegrams and of CAN frames in turn, as they were captured."""
        if rows.can is None:
            yield from self._lines.lines(rows)
            return
        on_can = rows.can.on_can
        frames = self._can_lines.lines(rows.part(on_can))
        telegrams = iter(()) if on_can.all() else self._lines.lines(rows.part(~on_can))
        for is_frame in on_can.tolist():
            yield next(frames if is_frame else telegrams)

    def _one_by_one(self, rows: TelegramRows) -> Iterator[str]:
        trees = None
        if self._trees:
            trees = Trees(rows, self._width, dumps=not self._dumps, layouts=self._layouts, pdos=self._pdos)
        heads: Iterator[Line] = iter(()) if trees else self._lines_of(rows)
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
    if rows.can is not None and rows.can.on_can[row]:
        # It stands among telegrams as if it had their header.
        data_at = min(payload_at + HEADER.size_bytes, len(packet))
        parts = (
            (max(data_at - FRAME.size_bytes, 0), Tone.FAINT), (data_at, Tone.STRONG),
            (payload_at + captured_bytes, Tone.PLAIN), (len(packet), Tone.FAINT),
        )  # fmt: skip
        return dump(packet, parts)
    parts = (
        (payload_at, Tone.FAINT),
        (payload_at + min(HEADER.size_bytes, captured_bytes), Tone.STRONG),
        (payload_at + captured_bytes, Tone.PLAIN),
        (len(packet), Tone.FAINT),
    )
    return dump(packet, parts)
