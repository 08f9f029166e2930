"""CanOpenSince: from which frame on a capture has shown that its frames are CANopen's."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import ClassVar

from msgspec import Struct, field

from dissectors.can.canopen import use_of
from nvscope.engine.told import Told
from nvscope.tracker.can.canopen import CanOpen, Since

_ALL = 0
"""In place of a node: what the NMT master said to all of them."""


class CanOpenSeen(Struct, frozen=True):
    """What was known at a moment of which frames are CANopen's, of all frames up to then.

    ``rows`` are those of ``since``, by channel and node.
    """

    rows: Mapping[int, Mapping[int, int]] = field(default_factory=dict)
    since: Since | None = None

    @staticmethod
    def of(seen: CanOpen, lists: Collection[int] = ()) -> CanOpenSeen:
        """Return what frames have shown; ``lists`` are the COB-IDs of lists, which are not CANopen's."""
        rows: dict[int, dict[int, int]] = {}
        for row, (channel, node) in enumerate(zip(seen.nodes.high.tolist(), seen.nodes.low.tolist(), strict=True)):
            rows.setdefault(channel, {})[node] = row
        return CanOpenSeen(rows, seen.since(lists) if rows else None)

    def of_frame(self, channel: int, cob_id: int, frame_number: int) -> bool:
        """Tell whether a frame of a COB-ID is CANopen's by what came up to it, with itself; as ``Evidence`` has it."""
        service, node = use_of(cob_id)
        row_of = self.rows.get(channel)
        if row_of is None or self.since is None or not service:
            return False
        rows = [row_of[one] for one in (node, _ALL) if one in row_of] if node else list(row_of.values())
        return bool(self.since.at(frame_number)[rows].any())


class CanOpenSince:
    """An observer for who shows frames one by one, as they come: what shows that there is CANopen comes among them.

    ``lists`` are the COB-IDs of lists, which are not CANopen's.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, lists: Collection[int] = ()) -> None:
        self._lists = lists
        self._seen = CanOpen()
        self._rows: dict[int, dict[int, int]] = {}
        self._known = CanOpenSeen(self._rows)

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for unheard in told.unheard:
            self._seen.resume(unheard)
        if told.can is None:
            return
        self._seen.observe(told, told.can)
        nodes = self._seen.nodes
        known = sum(map(len, self._rows.values()))
        fresh = zip(nodes.high[known:].tolist(), nodes.low[known:].tolist(), strict=True)
        for row, (channel, node) in enumerate(fresh, known):
            self._rows.setdefault(channel, {})[node] = row
        self._known = CanOpenSeen(self._rows, self._seen.since(self._lists))

    def of_frame(self, channel: int, cob_id: int, frame_number: int) -> bool:
        """Tell the same as ``CanOpenSeen`` does, by what was observed so far."""
        return self._known.of_frame(channel, cob_id, frame_number)
