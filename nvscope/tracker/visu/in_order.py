"""InOrder: what a batch brings of the streams of connections, before anybody has read what is said in them."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import PacketBatch
from dissectors.stretches import Uncopied
from nvscope.tracker.connections import Connections
from nvscope.tracker.pieces import Brought, OtherBytes
from nvscope.tracker.segments import StreamColumns
from nvscope.tracker.stream_places import Positions
from nvscope.tracker.streams import Outlived


class InOrder(Struct, frozen=True):
    """What a batch brings, with all that is needed of the streams to go on with it; also in another process.

    ``outlived`` are the connections that were kept in front of the batch, None where all were. ``before`` is where
    streams were then, ``columns`` where they are behind it. ``connections`` are those that are known now, None where
    they are the same as with the batch before. ``others`` are bytes that came again, and differ from those before.
    """

    outlived: Outlived | None
    before: Positions
    brought: Brought
    connections: Connections | None
    columns: StreamColumns
    others: Sequence[OtherBytes]

    def apart(self, packets: PacketBatch) -> tuple[InOrder, Uncopied]:
        """Return it, and the bytes of its pieces in packets and of those kept."""
        return self, self.brought.data(packets.data)

    def with_bytes(self, data: memoryview) -> InOrder:
        """Return it with the bytes of its pieces."""
        return replace(self, brought=replace(self.brought, together=data))
