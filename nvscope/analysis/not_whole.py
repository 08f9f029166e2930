"""NotWhole: how much of what filters and exports look into is not all there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np

from nvscope.engine.told import Told
from nvscope.units import count_of

if TYPE_CHECKING:
    from nvscope.tracker.visu.messages import VisuBatch

_PAGES = "visu"


class NotWhole:
    """An observer that counts frames of what is recognised, and of the ports of pages, that were not captured whole.

    ``gap_bytes`` are those that the capture lacks of connections of pages, be it within such frames or between others.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self) -> None:
        self.frames = self.gap_bytes = 0

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if not len(told):
            return
        is_cut = told.packets.captured < told.packets.original
        if is_cut.any():
            looked_at = np.zeros(len(told), np.bool_)
            looked_at[told.recognised] = True
            looked_at[told.batch.segments.row] = True
            self.frames += int(np.count_nonzero(is_cut & looked_at))
        part = cast("VisuBatch | None", told.parts.get(_PAGES))
        if part is not None:
            self.gap_bytes += int(part.messages.gap_bytes.sum())

    def sentences(self) -> Iterator[str]:
        """Yield what is to be said of that."""
        if self.frames:
            were = f"{count_of(self.frames, 'frame')} {'was' if self.frames == 1 else 'were'}"
            yield f"{were} not captured whole (a snap length): what is behind the end of one is not looked at."
        if self.gap_bytes:
            lacks = f"the capture lacks {count_of(self.gap_bytes, 'byte')} of web visualization"
            yield f"{lacks}: what was said there is not looked at."
