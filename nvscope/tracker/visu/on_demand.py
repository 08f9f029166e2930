"""WebVisu on demand: most plants have none, and until somebody speaks over its ports, nothing of it is imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np

from dissectors.batch import I64, Bool, PacketBatch
from dissectors.dissector import Part, Prepared
from dissectors.transport import SegmentBatch
from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.told import Told
from nvscope.tracker.accumulator import NO_SUMMARY, ProtocolSummary

if TYPE_CHECKING:
    from nvscope.definition.visu_encoding import Encoding
    from nvscope.definition.webvisu import GivenList
    from nvscope.tracker.visu.follower import VisuFollower
    from nvscope.tracker.visu.in_order import InOrder
    from nvscope.tracker.visu.state import VisuCounts

NAME, WRITES, UNCHANGING, OTHERS = "visu", "visu_writes", "visu_unchanging", "visu_others"


class _Nothing:
    """The part of a batch in which nothing was found."""

    row: I64 = np.empty(0, np.int64)

    def __len__(self) -> int:
        return 0

    def take(self, rows: I64 | Bool) -> _Nothing:
        return self


class FollowOnDemand:
    """Follows the connections over some ports, from the first segment on.

    ``given`` are lists of names of variables: those within the capture go before them. ``encodings`` are those of texts
    by address, '' for all: they go before what pages say.
    """

    def __init__(
        self, ports: Sequence[int], given: Sequence[GivenList] = (),
        encodings: Mapping[str, Encoding] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        self._ports, self._given, self._encodings = ports, given, encodings
        self._known: VisuFollower | None = None

    def prepare(self, packets: PacketBatch, segments: SegmentBatch, first_frame: int) -> InOrder | None:
        """Put the segments of a batch in order, if there are any."""
        return self._follower().prepare(packets, segments, first_frame) if len(segments) else None

    def follow(
        self, packets: PacketBatch, segments: SegmentBatch, first_frame: int, prepared: Prepared | None = None
    ) -> Part:  # fmt: skip
        """Return what the segments of a batch bring (``nvscope.tracker.visu.messages.VisuBatch``)."""
        if not len(segments):
            if self._known is not None:
                self._known.pass_time(packets, segments, first_frame)
            return _Nothing()
        return self._follower().follow(packets, segments, first_frame, cast("InOrder | None", prepared))

    def _follower(self) -> VisuFollower:
        if self._known is None:
            from nvscope.tracker.visu.follower import VisuFollower  # noqa: PLC0415

            self._known = VisuFollower(self._ports, self._given, encodings=self._encodings)
        return self._known

    def forget(self) -> None:
        """Forget where all connections are: nobody listened for a while."""
        if self._known is not None:
            self._known.forget()


class VisuState:
    """What became of all requests, ``known``: None before there is any."""

    SPLIT_BY: ClassVar = SplitBy.LIST  # of no list: all go to the first part

    def __init__(self) -> None:
        self.known: VisuCounts | None = None

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        part = told.parts.get(NAME)
        if part is None:
            if self.known is not None:
                self.known.observe(told, None)
            return
        from nvscope.tracker.visu.messages import VisuBatch  # noqa: PLC0415
        from nvscope.tracker.visu.state import VisuCounts  # noqa: PLC0415

        assert isinstance(part, VisuBatch)
        if self.known is None:
            self.known = VisuCounts()
        self.known.observe(told, part)

    def take(self, part: VisuState, share: Share) -> None:
        """Take over what the first part has counted: it has all of it."""
        if not share.part:
            self.known = part.known

    def summary(self) -> ProtocolSummary:
        """Return who asked whom, and what became of it."""
        if self.known is None:
            return NO_SUMMARY
        from nvscope.tracker.visu.summary import summarize_others, summarize_visu  # noqa: PLC0415

        further = {
            WRITES: self.known.writes.so_far(self.known.leaving.given_up()),
            UNCHANGING: self.known.unchanging.summary(),
            OTHERS: summarize_others(self.known),
        }
        return ProtocolSummary(summarize_visu(self.known), further, tuple(self.known.clients()))
