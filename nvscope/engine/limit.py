"""The limit of what is told apart: which streams are the first ones of a capture, however it is cut into batches.

What is beyond the limit is counted, and nothing else. Of whom something was left out is known (``LeftOut``): figures
and findings that hang on more than one stream are told of the others alone.
"""

from __future__ import annotations

from enum import IntFlag
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.batch import I64, U8, U16, U64, Bool
from dissectors.carried import Carrier
from dissectors.keys import KeyTable, first_rows
from dissectors.varieties import Varieties
from nvscope.engine.keyed_columns import KeyedColumns

if TYPE_CHECKING:  # who numbers flows asks here
    from nvscope.engine.keys import Keys

MAX_STREAMS = 50_000
"""So many streams, and so many flows of other telegrams, are told apart unless somebody says otherwise.

A plant has hundreds or thousands; a look at so many takes seconds and some 200 MB.
"""


ELSEWHERE = -2
"""The node of receivers that are not told apart."""


class Missing(IntFlag):
    """What of a list was left out."""

    DATA = 1
    ACKNOWLEDGEMENTS = 2
    OTHERS = 4


class _Parts(KeyedColumns):
    """One row a list: which parts of it were left out."""

    parts: U8
    COLUMNS: ClassVar = {"parts": (np.uint8(0), 1)}


class LeftOut:
    """Of which senders and lists something was left out.

    ``senders`` are the nodes, by number, of which well-formed data was left out, as far as they had a number. Lists are
    known whether they have one or not, the first ``MAX_STREAMS`` of them; if there were more, nobody knows of any list
    that all of it is there.
    """

    def __init__(self) -> None:
        self.senders: frozenset[int] = frozenset()
        self._lists = KeyTable(3)
        self._columns = _Parts()
        self._too_many = False

    def add(self, parts: U8, *lists: U64) -> None:
        """Take what was left out: ``parts`` of lists, given by their keys as in ``Keys.lists``, in their order."""
        number = self._lists.numbers_within(MAX_STREAMS, *lists)
        self._too_many |= bool((number < 0).any())
        known = number >= 0
        self._columns.resize(len(self._lists))
        np.bitwise_or.at(self._columns.parts, number[known], parts[known])

    def note(self, varieties: Varieties, which: I64, parts: U8, nodes: KeyTable) -> None:
        """Take varieties that were left out: of which parts of lists they are, 0 of none; ``nodes`` number senders."""
        which, parts = which[parts > 0], parts[parts > 0]
        self.add(parts, *list_words(varieties, which))
        data = which[(parts == Missing.DATA) & (varieties.carried.carrier[which] == Carrier.UDP)]
        datagram = varieties.telegrams.datagram.take(varieties.part[data])
        # All who have streams that are told apart are numbered by now.
        sender = nodes.find(datagram.source_hi, datagram.source_lo)
        self.senders |= frozenset(sender[sender >= 0].tolist())

    def note_rejected(self, port: I64 | U16, index: I64 | U16) -> None:
        """Take telegrams that came back and were left out, by the ports and the Indexes of their lists."""
        carrier = np.full(len(port), Carrier.UDP, np.uint64)
        parts = np.full(len(port), Missing.OTHERS, np.uint8)
        self.add(parts, carrier, port.astype(np.uint64), index.astype(np.uint64))

    def copied(self) -> LeftOut:
        """Return a copy that shares nothing with this one."""
        copy = LeftOut()
        copy.senders, copy._too_many = self.senders, self._too_many
        copy._lists.numbers(*self._lists.words)
        copy._columns = self._columns.copied()
        return copy

    def of_lists(self, lists: KeyTable) -> U8:
        """Return which parts of lists were left out, or may have been, by the numbers that ``lists`` give them."""
        if self._too_many:
            return np.full(len(lists), sum(Missing), np.uint8)
        number = self._lists.find(*lists.words)
        parts: U8 = np.append(self._columns.column("parts"), np.uint8(0))[number]  # -1 is the last one
        return parts


def with_room(
    keys: Keys, varieties: Varieties, new: I64, kind: U8, nobody: int, is_data: Bool
) -> tuple[Bool, Bool]:  # fmt: skip
    """Tell which new varieties, in the order of the capture, are told apart, and which of these not by their receiver.

    Of data there is room for the first ``keys.most`` streams, whoever receives them, and for as many receivers beside
    the first one of each; of others for as many flows: however many streams there are, those in front go on hearing
    their acknowledgements. ``kind`` is what the varieties are, ``is_data`` those of data; ``nobody`` is the node of
    what has no address. Nothing is numbered here.
    """
    on_udp = varieties.carried.carrier[new] == Carrier.UDP
    datagram = varieties.telegrams.datagram.take(varieties.part[new[on_udp]])
    ends = np.zeros((4, len(new)), np.uint64)
    alone = np.zeros(len(new), np.bool_)
    alone[on_udp] = ~datagram.broadcast
    ends[:2, on_udp] = datagram.source_hi, datagram.source_lo
    ends[2:, on_udp] = datagram.destination_hi, datagram.destination_lo
    ends[2:, ~alone] = 0
    source, destination = np.full(len(new), nobody), np.full(len(new), nobody)
    source[on_udp], destination[alone] = keys.nodes.find(*ends[:2, on_udp]), keys.nodes.find(*ends[2:, alone])
    place = *list_words(varieties, new), varieties.carried.subindex[new].astype(np.uint64)
    lists = keys.lists.find(*place[:3])
    number = keys.places.find(lists.view(np.uint64), place[3])
    of_source = source.view(np.uint64)
    words = of_source, destination.view(np.uint64), number.view(np.uint64), kind.astype(np.uint64)
    # Who is not known is not nobody.
    placed = (lists >= 0) & (number >= 0) & ((source >= 0) | ~on_udp)
    in_stream = placed & is_data & (keys.streams.find(number.view(np.uint64), of_source) >= 0)
    in_flow = placed & ((destination >= 0) | ~alone) & (keys.flows.find(*words) >= 0)
    stream = *ends[:2], *place
    flow = *stream, *ends[2:], alone.astype(np.uint64) << np.uint64(8) | kind
    flows, streams = keys.columns, len(keys.streams)
    of_data = flows.column("stream") >= 0
    room = in_stream | (in_flow & ~is_data)
    for own, key, left in (
        (is_data, stream, keys.most - streams),
        (~is_data, flow, keys.most - int(np.count_nonzero(~of_data))),
    ):
        fresh = np.flatnonzero(own & ~room)
        room[fresh] = _within(left, key, fresh) >= 0
    further = int(np.count_nonzero(of_data & (flows.column("destination") != ELSEWHERE))) - streams
    begins = np.flatnonzero(is_data & room & ~in_flow)
    return room, _beyond(begins, in_stream, stream, flow, keys.most - further)


def pairs(varieties: Varieties, which: I64) -> tuple[U64, U64, U64, U64]:
    """Return the ends of some varieties, the same whoever of both sends: requests without replies would look lost."""
    datagram = varieties.telegrams.datagram.take(varieties.part[which])
    one, other = (datagram.source_hi, datagram.source_lo), (datagram.destination_hi, datagram.destination_lo)
    turned = (one[0] > other[0]) | ((one[0] == other[0]) & (one[1] > other[1]))
    (one_hi, other_hi), (one_lo, other_lo) = (
        (np.where(turned, there, here), np.where(turned, here, there)) for here, there in zip(one, other, strict=True)
    )
    return one_hi, one_lo, other_hi, other_lo


def list_words(varieties: Varieties, which: I64) -> tuple[U64, U64, U64]:
    """Return the keys of the lists of some varieties, as in ``Keys.lists``."""
    carried = varieties.carried
    carrier, port, identifier = (
        column[which].astype(np.uint64) for column in (carried.carrier, carried.port, carried.identifier)
    )
    return carrier, port, identifier


def _within(most: int, key: tuple[U64, ...], row: I64) -> I64:
    return KeyTable(len(key)).numbers_within(most, *(word[row] for word in key))


def _beyond(begins: I64, in_stream: Bool, stream: tuple[U64, ...], flow: tuple[U64, ...], most: int) -> Bool:
    """Tell which of the rows ``begins``, of flows of data that are not known, are beyond ``most`` further receivers.

    The first flow of a stream that is not known either is none of these.
    """
    number = KeyTable(len(flow)).numbers(*(word[begins] for word in flow))
    first = begins[first_rows(number, int(number.max(initial=-1)) + 1)]
    is_further = in_stream[first]
    fresh = first[~is_further]
    of_stream = KeyTable(len(stream)).numbers(*(word[fresh] for word in stream))
    leading = first_rows(of_stream, int(of_stream.max(initial=-1)) + 1)
    follows = np.ones(len(fresh), np.bool_)
    follows[leading] = False
    is_further[~is_further] = follows
    beyond = np.zeros(len(in_stream), np.bool_)
    beyond[begins] = (is_further & (np.cumsum(is_further) > most))[number]
    return beyond
