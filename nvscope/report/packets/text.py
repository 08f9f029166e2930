"""Telegrams as text for people: a line each, or a tree, with or without the bytes of the frame."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from nvscope.protocols.protocol import Protocol
from nvscope.protocols.table import PROTOCOLS
from nvscope.report.ansi import paint
from nvscope.units import count_of
from nvscope.view.lines.hexdump import dump
from nvscope.view.lines.mixed_lines import MixedLines, line_makers
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.netvar_line import LineWriter
from nvscope.view.lines.shown import HIDDEN_BYTES, Spans, Wording
from nvscope.view.lines.table import Cell, Line, Tone
from nvscope.view.lines.tree import Trees
from nvscope.view.rows.frames import FrameRows

if TYPE_CHECKING:
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.parameters import Parameters
    from nvscope.definition.pdos import Pdos
    from nvscope.tracker.can.canopen_since import CanOpenSince


class Text:
    """The text of pieces that follow each other, as a ``Face``.

    With ``trees`` a tree takes the place of the line. With ``dumps`` the captured bytes follow. ``width`` limits lines
    and trees, not dumps; None for no limit. ``layouts`` name the variables in trees, ``names`` the nodes in lines, by
    the text of their address, ``pdos`` the lists on CAN, ``canopen`` what is CANopen's, ``parameters`` those
    of the Parameter Manager; ``protocols`` are those that rows may be of. Passwords of web visualization, and the bytes
    that go over its ``page_ports``, are shown with ``secrets`` alone. With and without ``colour`` the text is the same.
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
        canopen: CanOpenSince | None = None,
        parameters: Parameters | None = None,
        secrets: bool = False,
        page_ports: Collection[int] = (),
        protocols: Sequence[Protocol] = PROTOCOLS,
    ) -> None:
        self._trees = trees
        self._dumps = dumps
        self._width = width
        self._colour = colour
        self._wording = Wording(names, layouts, pdos, canopen, parameters, secrets, page_ports)
        self._make_trees = {protocol.name: protocol.tree() for protocol in protocols}
        self._lines = line_makers(
            {protocol.name: protocol.lines() for protocol in protocols}, moment, width, self._wording
        )
        self._mixed = MixedLines(self._lines, width)

    def begin(self) -> str:
        return ""

    def render(self, rows: FrameRows) -> Iterator[str]:
        """Yield the text of a piece: at once where it is lines only, else of a telegram at a time."""
        if self._trees or self._dumps:
            yield from self._one_by_one(rows)
            return
        writer = self._lines[rows.protocols[0]] if len(rows.protocols) == 1 and not self._mixed.mixed else None
        if isinstance(writer, LineWriter) and not self._colour:
            yield "\n".join(writer.texts(rows)) + "\n"
        else:
            yield paint(self._lines_of(rows), colour=self._colour)

    def end(self) -> str:
        return ""

    def _lines_of(self, rows: FrameRows) -> Iterator[Line]:
        """Return the lines of the frames, as they were captured."""
        return self._mixed.lines(rows)

    def _one_by_one(self, rows: FrameRows) -> Iterator[str]:
        trees = Trees(rows, self._make_trees, self._wording, self._width, dumps=not self._dumps)
        heads: Iterator[Line] = iter(()) if self._trees else self._lines_of(rows)
        for row in range(len(rows)):
            text: list[Line] = []
            if self._trees:
                text += trees.lines(row)
                text += [[]] * self._dumps
            else:
                text.append(next(heads))
            if self._dumps:
                text += _dump(rows, row, trees.spans(row))
            text.append([])
            yield paint(text, colour=self._colour)


def _dump(rows: FrameRows, row: int, spans: Spans) -> Iterator[Line]:
    """Yield the captured bytes of a frame: what is in front of the message faint, its header strong."""
    packet = rows.packets.packet(int(rows.row[row]))
    if spans.hidden:
        yield from dump(packet[: spans.start], [(spans.start, Tone.FAINT)])
        hidden = count_of(len(packet) - spans.start, "byte")
        yield [Cell(f"{spans.start:04x}  ", Tone.FAINT), Cell(f"{hidden} {HIDDEN_BYTES}", Tone.WARNING)]
        return
    parts = (
        (spans.start, Tone.FAINT),
        (spans.data, Tone.STRONG),
        (spans.stop, Tone.PLAIN),
        (len(packet), Tone.FAINT),
    )
    yield from dump(packet, parts)
