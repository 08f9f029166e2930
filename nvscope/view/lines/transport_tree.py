"""What all trees of messages over UDP and TCP have in common: where the message lies, and what is in front of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.transport import SegmentBatch, TransportBatch
from nvscope.view.lines.layers import Layer, layers_of_datagram, layers_of_segment
from nvscope.view.lines.shown import Spans
from nvscope.view.rows.frames import FrameRows


class TransportTree:
    """The part of a ``Tree`` that is the same for each protocol ``name`` whose part has their ``datagram``.

    Over TCP it has their ``segment``. A message begins with a header of ``header_bytes``, or with what was captured of
    it.
    """

    def __init__(self, rows: FrameRows, name: str, header_bytes: int) -> None:
        found = rows.parts[name]
        self._over: TransportBatch = found.part.segment if hasattr(found.part, "segment") else found.part.datagram
        row = rows.row[found.positions(len(rows))]
        self._packet_at = rows.packets.offset[row]
        # Where a capture ends within the options of a segment, its data would begin behind what there is.
        self._start = np.minimum(self._over.payload - self._packet_at, rows.packets.captured[row])
        self._header_bytes = header_bytes

    def spans(self, place: int) -> Spans:
        start, captured = int(self._start[place]), int(self._over.captured_bytes[place])
        return Spans(start, start + min(self._header_bytes, captured), start + captured)

    def layers(self, place: int, packet: bytes, link: int) -> Sequence[Layer]:
        start, over = int(self._start[place]), self._over
        if isinstance(over, SegmentBatch):
            return layers_of_segment(packet, link, int(over.header[place] - self._packet_at[place]), start)
        return layers_of_datagram(packet, link, start)
