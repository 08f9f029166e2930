"""The limit of what is told apart: which flows are the first ones of a capture, however it is cut into batches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.carried import Carrier
from dissectors.keys import KeyTable
from dissectors.varieties import Varieties

if TYPE_CHECKING:  # who numbers flows asks here
    from nvscope.engine.keys import Keys

MAX_STREAMS = 200_000
"""So many flows of data, and so many others, are told apart unless somebody says otherwise.

A plant has hundreds or thousands; a report on so many takes some seconds and less than a gigabyte.
"""


def flows_with_room(
    keys: Keys, varieties: Varieties, new: I64, kind: U8, nobody: int, is_data: Bool
) -> Bool:  # fmt: skip
    """Tell which new varieties, in the order of the capture, are of flows that are known or still have room.

    There is room for ``keys.most`` flows of data, and for as many others: however many streams there are, those in
    front go on hearing their acknowledgements. ``kind`` is what the varieties are, ``is_data`` those of data;
    ``nobody`` is the node of what has no address. Nothing is numbered here.
    """
    on_udp = varieties.carried.carrier[new] == Carrier.UDP
    carried = varieties.carried.take(new)
    datagram = varieties.telegrams.datagram.take(varieties.part[new[on_udp]])
    ends = np.zeros((4, len(new)), np.uint64)
    alone = np.zeros(len(new), np.bool_)
    alone[on_udp] = ~datagram.broadcast
    ends[:2, on_udp] = datagram.source_hi, datagram.source_lo
    ends[2:, on_udp] = datagram.destination_hi, datagram.destination_lo
    ends[2:, ~alone] = 0
    source, destination = np.full(len(new), nobody), np.full(len(new), nobody)
    source[on_udp], destination[alone] = keys.nodes.find(*ends[:2, on_udp]), keys.nodes.find(*ends[2:, alone])
    place = tuple(
        word.astype(np.uint64) for word in (carried.carrier, carried.port, carried.identifier, carried.subindex)
    )  # fmt: skip
    lists = keys.lists.find(*place[:3])
    number = keys.places.find(lists.view(np.uint64), place[3])
    words = source.view(np.uint64), destination.view(np.uint64), number.view(np.uint64), kind.astype(np.uint64)
    known: Bool = (keys.flows.find(*words) >= 0) & (lists >= 0) & (number >= 0)
    # Who is not known is not nobody.
    known &= ((source >= 0) | ~on_udp) & ((destination >= 0) | ~alone)
    key = *ends, *place, alone.astype(np.uint64) << np.uint64(8) | kind
    of_data = int(np.count_nonzero(keys.columns.column("stream") >= 0))
    for own, flows in ((is_data, of_data), (~is_data, len(keys.flows) - of_data)):
        fresh = np.flatnonzero(own & ~known)
        further = KeyTable(len(key)).numbers_within(keys.most - flows, *(word[fresh] for word in key))
        known[fresh] = further >= 0
    return known
