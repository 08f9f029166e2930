"""CAN frames of tests as the rows that packets, filters and fields are about."""

from __future__ import annotations

import tempfile
from pathlib import Path

from dissectors.batch import PacketBatch
from nvscope.capture.open import open_source
from nvscope.definition.model import Definition
from nvscope.definition.pdos import Pdos
from nvscope.engine.reading import Reading
from nvscope.view.rows.frames import FrameRows
from tests.packets import Shown


def batches_of_log(log: str) -> tuple[list[PacketBatch], list[str]]:
    """Return what a candump log holds, and what its channels are called."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.log"
        path.write_text(log)
        source = open_source([str(path)])
        return list(source), list(source.channels)


def rows_of_log(log: str, definition: Definition | None = None) -> FrameRows:
    """Return the frames of a candump log, few enough to be one piece."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.log"
        path.write_text(log)
        source = open_source([str(path)])
        (rows,) = Shown(source, Reading(pdos=Pdos(definition or Definition()).rules()))
        return rows
