"""What all trees of messages in UDP datagrams have in common: where the message lies, and what is in front of it."""

from __future__ import annotations

from collections.abc import Sequence

from dissectors.transport import DatagramBatch
from nvscope.view.lines.layers import Layer, layers
from nvscope.view.lines.shown import Spans
from nvscope.view.rows.frames import FrameRows


class DatagramTree:
    """The part of a ``Tree`` that is the same for each protocol ``name`` whose part has their ``datagram``.

    A message begins with a header of ``header_bytes``, or with what was captured of it.
    """

    def __init__(self, rows: FrameRows, name: str, header_bytes: int) -> None:
        found = rows.parts[name]
        self._datagram: DatagramBatch = found.part.datagram
        self._start = self._datagram.payload - rows.packets.offset[rows.row[found.positions(len(rows))]]
        self._header_bytes = header_bytes

    def spans(self, place: int) -> Spans:
        start, captured = int(self._start[place]), int(self._datagram.captured_bytes[place])
        return Spans(start, start + min(self._header_bytes, captured), start + captured)

    def layers(self, place: int, packet: bytes, link: int) -> Sequence[Layer]:
        return layers(packet, link, int(self._start[place]))
