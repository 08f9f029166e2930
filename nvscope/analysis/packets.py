"""Packets: the telegrams and CAN frames of captures one by one, in pieces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from nvscope.capture.source import Source
from nvscope.engine.reading import Reading
from nvscope.engine.run import Observer, run
from nvscope.view.rows.frames import FrameRows, PacketRows


def packets(
    source: Source,
    reading: Reading,
    rows: PacketRows,
    progress: Callable[[], None] = lambda: None,
    others: Sequence[Observer] = (),
) -> Iterator[FrameRows]:
    """Yield the rows of a source, a piece at a time, until ``rows`` have as many as they want.

    ``progress`` is called after each piece and each batch, so also where nothing is shown. ``others`` observe each
    batch before its rows are yielded.
    """
    for _ in run(source, reading, [*others, rows]):
        for piece in rows.pieces():
            yield piece
            progress()
        progress()
        if rows.full:
            return
