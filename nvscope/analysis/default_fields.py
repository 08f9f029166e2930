"""Which fields are written of each frame where nobody says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dissectors.batch import LinkType, PacketBatch
from dissectors.can.frame import dissect_can
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.source import FileSource, Source
from nvscope.engine.recogniser import Recogniser
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import DEFAULT_ALL_FIELDS, DEFAULT_CAN_FIELDS, DEFAULT_FIELDS


def default_fields(inquiry: Inquiry, source: Source, *, all_frames: bool = False) -> Sequence[TelegramField]:
    """Return them, by what the captures of an inquiry begin with.

    ``all_frames``: also of those that are no telegrams.
    """
    on_can = others = of_rows = False
    further: set[str] = set()
    for first in source.first_batches() if isinstance(source, FileSource) else ():
        frames = len(dissect_can(first))
        on_can |= frames > 0
        rows = int(np.count_nonzero(first.link == LinkType.DATABASE_ROW))
        of_rows |= rows > 0
        others |= frames + rows < len(first)
        further |= _further_protocols(inquiry, first)
    usual = DEFAULT_ALL_FIELDS if all_frames else DEFAULT_FIELDS
    plain = others or not (on_can or of_rows)
    fields = [*(usual if plain else ()), *(DEFAULT_CAN_FIELDS if on_can else ())]
    if not fields:  # rows of databases alone, which have no address and no telegram
        fields = [field for field in DEFAULT_FIELDS if field.name.startswith("frame.")]
    fields += (field for one in inquiry.protocols if one.name in further for field in one.fields())
    # Fields cannot be compared, their names can.
    return tuple({field.name: field for field in fields}.values())


def _further_protocols(inquiry: Inquiry, first: PacketBatch) -> set[str]:
    """Return which protocols with ports of their own some packets are of."""
    reading = inquiry.reading()
    if not reading.dissectors:
        return set()
    return {name for told in Recogniser(reading, by_stream=False).tell(first) for name in told.parts}
