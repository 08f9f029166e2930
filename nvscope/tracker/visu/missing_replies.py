"""Missing replies: whether a client has got bytes of its server that the capture lacks, behind all that there is.

Nothing comes behind such bytes that would show the hole: only that the client acknowledges them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nvscope.tracker.pieces import ORDER_BITS, Pieces
from nvscope.tracker.segments_aside import missing_behind
from nvscope.tracker.stream_places import Positions, StreamPlaces
from nvscope.tracker.visu.conversation import Conversation
from nvscope.tracker.visu.one_way import OneWay
from nvscope.tracker.visu.reach import UNKNOWN, latest


class MissingReplies:
    """Those of a batch that brings some pieces to ``streams``, which were at ``before`` in front of it.

    Few batches are ever asked.
    """

    def __init__(self, one_way: OneWay, before: Positions, streams: StreamPlaces, pieces: Pieces) -> None:
        self._one_way, self._pieces = one_way, pieces
        self._before, self._streams = before, streams

    def in_front_of(self, order: int, connection: int, began: int) -> Callable[[int], bool]:
        """Return what tells whether there are some in front of an order to a client that had so much when it asked.

        ``began`` is the order with which the connection did.
        """
        server = 2 * connection + 1
        begin, end = np.searchsorted(self._pieces.stream, (server, server + 1)).tolist()
        place = begin + int(np.searchsorted(self._pieces.order[begin:end], order)) - 1
        at, _ = self._before.of(server)
        if place >= begin and self._pieces.order[place] >= began:
            at = int(self._pieces.behind[place])
        told = self._most_told(order >> ORDER_BITS, connection, began)
        return lambda had: at != UNKNOWN and _are_behind(at, told, had)

    def at_end(self, order: int, conversation: Conversation) -> Callable[[int], bool]:
        """Return the same where a connection ends with an order, of what the end itself acknowledges, too.

        Of a server that was heard, what is missing in front of its end was told.
        """
        if conversation.is_heard:
            return lambda _: False
        told = self._most_told((order >> ORDER_BITS) + 1, conversation.connection, conversation.began)
        return lambda had: had != UNKNOWN and _are_behind(UNKNOWN, told, had)

    def _most_told(self, stop: int, connection: int, began: int) -> int:
        """Return how far a client acknowledges its server in front of a frame, at most."""
        first = began >> ORDER_BITS
        told = self._one_way.most_acknowledged(2 * connection, first, stop)
        if first < self._one_way.first_frame:
            _, before_told = self._before.of(2 * connection + 1)
            told = latest([before_told, told])
        return told

    def to(self, conversation: Conversation, had: int) -> Callable[[], bool]:
        """Return what tells the same, whenever it is asked, of a conversation behind all that is read."""
        streams = self._streams

        def lacks() -> bool:
            at, told = streams.position(2 * conversation.connection + 1)
            return conversation.turns.owed.may_have_answered(had) or _are_behind(at, told, had)

        return lacks


def _are_behind(at: int, told: int, had: int) -> bool:
    """Tell whether bytes are missing of a server, known up to ``at`` if at all, that is acknowledged up to ``told``.

    What its client had before it asked is no answer to that, and is not missing for it.
    """
    return missing_behind(latest([at, had]), [told]) > 0
