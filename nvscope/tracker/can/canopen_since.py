"""CanOpenSince: from which frame on a capture has shown that its frames are CANopen's."""

from __future__ import annotations

from collections.abc import Collection
from typing import ClassVar

import numpy as np

from dissectors.can.canopen import use_of
from nvscope.engine.told import Told
from nvscope.tracker.can.canopen import NEVER, CanOpen

_ALL, _ANY = 0, -1
"""In place of a node: what the NMT master said to all of them; the first evidence of any."""


class CanOpenSince:
    """An observer for who shows frames one by one, as they come: what shows that there is CANopen comes among them.

    ``lists`` are the COB-IDs of lists, which are not CANopen's.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, lists: Collection[int] = ()) -> None:
        self._lists = lists
        self._seen = CanOpen()
        self._frames: dict[int, dict[int, int]] = {}

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        if told.can is None:
            return
        self._seen.observe(told, told.can)
        since, nodes = self._seen.since(self._lists), self._seen.nodes
        row = np.flatnonzero(since >= told.first_frame)
        row = row[since[row] < NEVER]
        for channel, node, frame in zip(
            nodes.high[row].tolist(), nodes.low[row].tolist(), since[row].tolist(), strict=True
        ):
            first = self._frames.setdefault(channel, {})
            first[node] = frame
            first[_ANY] = min(frame, first.get(_ANY, NEVER))

    def of_frame(self, channel: int, cob_id: int, frame_number: int) -> bool:
        """Tell whether a frame of a COB-ID is CANopen's by what came up to it, with itself; as ``Evidence`` has it."""
        service, node = use_of(cob_id)
        first = self._frames.get(channel)
        if first is None or not service:
            return False
        since = min(first.get(node, NEVER), first.get(_ALL, NEVER)) if node else first[_ANY]
        return since <= frame_number
