"""VisuFollower: from the segments of claimed ports to what WebVisu pages and controllers say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dissectors.batch import PacketBatch
from dissectors.transport import SegmentBatch
from dissectors.webvisu import Place
from nvscope.tracker.streams import Streams
from nvscope.tracker.visu.exchanges import Exchanges
from nvscope.tracker.visu.http_messages import HttpStreams
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.names import NO_NAMES


class VisuFollower:
    """Follows the connections over some ports, from one batch to the next; ``names`` are those given of variables."""

    def __init__(self, ports: Sequence[int], names: Mapping[Place, str] = NO_NAMES) -> None:
        self._streams = Streams(ports)
        self._http = HttpStreams()
        self._exchanges = Exchanges(self._streams.connections, names)

    def follow(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> VisuBatch:
        """Return what the segments of a batch bring, which follows those before; its row 0 is frame ``first_frame``."""
        brought = self._streams.observe(packets, segments, first_frame)
        messages = self._http.read(packets.data, brought, self._exchanges.heads_that_wait)
        return self._exchanges.take(messages, packets, segments, first_frame)

    def forget(self) -> None:
        """Forget where all connections are: what comes next of them begins in the middle."""
        self._streams.forget()
        self._http.forget()
        self._exchanges.forget()
