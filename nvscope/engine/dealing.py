"""Dealing: one timeline shared out, so that several cores, processes or machines can count parts of it.

Batches are recognised once. Their telegrams are dealt out by a key along which what counts them may be split, each part
is folded apart, and the parts are joined to the state that folding all at once gives.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from functools import cached_property

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from dissectors.batch import I64, Bool
from dissectors.sorter import SortedPackets
from dissectors.transport import NO_DATAGRAMS, NO_SEGMENTS
from dissectors.varieties import NO_TELEGRAM
from nvscope.engine.keys import Begun, Keys, Rejected
from nvscope.engine.told import Told


class SplitBy(Enum):
    """What telegrams may be dealt out by."""

    NOTHING = "all frames have to be seen in turn"
    LIST = "by list: whoever sends or reads it"
    SENDER = "by who sends: a node with all its lists, on CAN a channel"
    BUS = "by CAN channel"


class Share(Struct, frozen=True, dict=True):
    """The part number ``part`` of ``parts``, as of what ``keys`` number now; rows are the numbers that are its own.

    What is of no list goes to the first part.
    """

    keys: Keys
    by: SplitBy
    parts: int
    part: int

    def is_own(self, number: I64) -> Bool:
        """Tell which numbers of what it is split by (lists, nodes, channels; -1 for none) are this part's."""
        own: Bool = np.maximum(number, 0) % self.parts == self.part
        return own

    @cached_property
    def lists(self) -> I64:
        """The lists that are dealt to this part, where it is split by list."""
        return np.flatnonzero(self._lists)

    @cached_property
    def nodes(self) -> I64:
        """The nodes whose telegrams are dealt to this part."""
        return np.flatnonzero(self.is_own(np.arange(len(self.keys.nodes))))

    @cached_property
    def places(self) -> I64:
        """The places of its lists."""
        return np.flatnonzero(self._lists[self.keys.list_of_place(np.arange(len(self.keys.places)))])

    @cached_property
    def flows(self) -> I64:
        """The flows of its lists."""
        return np.flatnonzero(self._lists[self.keys.columns.column("list")])

    @cached_property
    def streams(self) -> I64:
        """The streams that are dealt to this part."""
        return np.flatnonzero(self.owns_streams)

    @cached_property
    def owns_streams(self) -> Bool:
        """The same as a mask."""
        keys = self.keys
        every = np.arange(len(keys.streams))
        return self.owns(keys.list_of_place(keys.place_of(every)), keys.node_of(every))

    @cached_property
    def owns_varieties(self) -> Bool:
        """The varieties of telegrams that are dealt to this part, as a mask."""
        varieties = self.keys.varieties
        return self.owns(varieties.column("list"), varieties.column("node"))

    @cached_property
    def _lists(self) -> Bool:
        return self.is_own(np.arange(len(self.keys.lists)))

    def owns(self, lists: I64, node: I64) -> Bool:
        """Tell which telegrams of lists (-1 for none), sent by nodes (-1 for nobody), are dealt to this part."""
        if self.by is SplitBy.LIST:
            return self.is_own(lists)
        channel = np.append(self.keys.list_ports, 0)[lists]
        return self.is_own(np.where(node >= 0, node, channel))


def deal(told: Told, by: SplitBy, parts: int) -> Iterator[tuple[Share, Told]]:
    """Yield each part of what is told, with whose part it is; what is not its own is a frame without a telegram."""
    for part in range(parts):
        share = Share(told.keys, by, parts, part)
        yield share, _channels(told, share) if by is SplitBy.BUS else _telegrams(told, share)


def _telegrams(told: Told, share: Share) -> Told:
    laid, own = told.laid, share.owns_varieties
    begun, rejected = laid.begun, laid.rejected
    mine = own[told.variety[begun.packet]]
    back = np.flatnonzero(share.owns(rejected.list, rejected.node))
    others = replace(
        laid,
        begun=Begun(begun.flow[mine], begun.packet[mine]),
        count=np.where(own, laid.count, 0),
        data=laid.data.of(share.owns_streams),
        pdos=laid.pdos.of(share.owns_streams),
        parameters=laid.parameters.of(own),
        rejected=Rejected(rejected.telegrams.take(back), *(column[back] for column in rejected[1:])),
    )
    variety = np.where(own[told.variety], told.variety, NO_TELEGRAM)
    return told.part(replace(_of_no_list(told, share), variety=variety), others, with_parts=not share.part)


def _channels(told: Told, share: Share) -> Told:
    batch, frames = _of_no_list(told, share), told.can
    if frames is not None:
        own = np.flatnonzero(share.is_own(frames.channel.astype(np.int64)))
        batch = replace(batch, can=frames.take(own) if len(own) else None)
    return told.part(batch, told.laid, with_parts=not share.part)


def _of_no_list(told: Told, share: Share) -> SortedPackets:
    """Return the batch, with what was claimed beside telegrams and CAN frames in the first part alone."""
    return told.batch if not share.part else replace(told.batch, datagrams=NO_DATAGRAMS, segments=NO_SEGMENTS)
