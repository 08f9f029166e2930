"""Early replies: responses that were captured before the requests that they may answer, until these come."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from msgspec import Struct, field

from nvscope.tracker.visu.awaited import Early
from nvscope.tracker.visu.limits import MOST_EARLY
from nvscope.tracker.visu.reach import UNKNOWN, Reach, distance, is_had


class EarlyReplies(Struct):
    """Those of a connection, the first ``MOST_EARLY`` ones.

    ``is_torn``: bytes of the server are missing behind them, with which it lost step, or there was no room for a
    response. What comes there may answer another request than the next one.
    """

    kept: deque[Early] = field(default_factory=deque)
    is_torn: bool = False

    def __len__(self) -> int:
        return len(self.kept)

    def __iter__(self) -> Iterator[Early]:
        return iter(self.kept)

    @property
    def first(self) -> Early:
        """The one that came first, where there is one."""
        return self.kept[0]

    @property
    def has_begun(self) -> bool:
        """Whether what the client has begun is answered."""
        return bool(self.kept) and self.kept[0].has_begun

    def reaches(self) -> list[Reach]:
        """Return where those lie that answer nothing that has begun."""
        return [one.reach for one in self.kept if not one.has_begun]

    def keep(self, one: Early) -> bool:
        """Keep a response that may answer a request that is still to come, if that is known to be the next one."""
        # What there is no room for is missing behind them: without the first one, each would answer another request.
        self.is_torn |= len(self.kept) == MOST_EARLY
        if self.kept and self.is_torn:
            return False
        self.kept.append(one)
        return True

    def take(self) -> Early:
        """Return the first one, and keep it no more."""
        return self.kept.popleft()

    def fit(self, reach: Reach, *, knows_head: bool = False, acknowledges: bool = False) -> bool:
        """Tell whether the first one may answer a request that lies there; forget what answers none to come.

        What answers a request that has begun does so, unless the server lacks its head: where that ``knows_head``, and
        the server ``acknowledges`` what it answers, or the client had all of the response when it asked. Of a response
        that is missing, the latter is enough.
        """
        while self.kept:
            first, one = self.kept[0], self.kept[0].reach
            ahead = distance(one.acknowledged, reach.body_at)
            was_had = is_had(one.behind, reach.acknowledged)
            lacks_head = was_had if first.is_lost else knows_head and ahead < 0 and (acknowledges or was_had)
            if not lacks_head if first.has_begun else ahead >= 0 and reach.body_at != UNKNOWN:
                return True
            self.kept.popleft()
        return False

    def ends_torn(self) -> bool:
        """Tell whether none is left in front of bytes that are missing; they count no more then."""
        is_torn, self.is_torn = self.is_torn, self.is_torn and bool(self.kept)
        return is_torn and not self.is_torn

    def copy(self) -> EarlyReplies:
        """Return another one that is as this one is."""
        return EarlyReplies(deque(self.kept), self.is_torn)
