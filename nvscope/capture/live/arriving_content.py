"""The content of a capture that is being written: what has come of it, and pauses."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from nvscope.capture.content import Content, ContentSizes
from nvscope.capture.live.byte_feed import ByteFeed
from nvscope.capture.time_span import TimeSpan
from nvscope.errors import UnreadableInput

MOST_BYTES = 8 << 20
"""So many bytes are taken at a time."""

_HEAD_BYTES = 64 << 10
_MOST_HEAD_BYTES = 4 << 20


class NotYet(BaseException):
    """More bytes are needed than have come: no error, and nothing that a library on the way may take for one."""


class ArrivingPieces:
    """The bytes of a feed in pieces, as far as ``take`` has taken them; an empty piece says that no more have.

    Until somebody has ``told`` by the first of them what they are, they are kept, and NotYet is raised in place of an
    empty piece: it is tried once more when more have come.
    """

    def __init__(self, feed: ByteFeed) -> None:
        self.feed = feed
        self._ready: deque[bytes] = deque()
        self._kept: list[bytes] | None = []

    @property
    def position(self) -> int:
        return self.feed.position

    @property
    def are_there(self) -> bool:
        """Whether there are pieces that nobody has asked for yet."""
        return bool(self._ready)

    def take(self, most_bytes: int = MOST_BYTES) -> int:
        """Take what is there, about ``most_bytes`` of it at most; return how many bytes.

        UnreadableInput where much has come, and nobody can tell what it is.
        """
        if self._kept is not None:
            if sum(map(len, self._kept)) > _MOST_HEAD_BYTES:
                raise UnreadableInput("no capture begins in the first 4 MiB", next_step="give a pcap or pcapng stream")
            most_bytes = min(most_bytes, _HEAD_BYTES)
        taken = 0
        while taken < most_bytes and (piece := self.feed.read()):
            taken += len(piece)
            self._ready.append(piece)
        if self._kept is not None:
            self._kept += self._ready
            self._ready.clear()
        return taken

    def told(self) -> None:
        """Keep nothing any more."""
        self._kept = None

    def __iter__(self) -> Iterator[bytes]:
        yield from self._kept or ()
        if self._kept is not None and not self.feed.ended:
            raise NotYet
        while True:
            while self._ready:
                yield self._ready.popleft()
            if self.feed.ended:
                return
            yield b""


class ArrivingContent(Content):
    """The content of a stream. Raises NotYet where what has come does not tell what it is."""

    pauses = True

    def __init__(self, path: str, pieces: ArrivingPieces) -> None:
        self.path = path
        self.span = TimeSpan()
        self.regular, self.size_bytes = False, None
        self._descriptor = -1
        self._sizes = ContentSizes()
        self._window = self._decompressed = None
        self._input = pieces
        self._pieces = iter(pieces)
        self._by_pieces = True
        self._begin(self._peek())
