"""ListFacts: what an observer can know of one network variables list, counted once for all that is told of it."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64
from dissectors.netvar import CHECKSUM_PRESENT
from nvscope.list_key import ListKey
from nvscope.simulate.frames import IPAddress, address_order
from nvscope.simulate.observation import Observation
from nvscope.simulate.replies import (
    Counts,
    missing_acknowledgements,
    negative_acknowledgements,
    unanswered_requests,
    unexpected_acknowledgements,
)
from nvscope.simulate.template import Role


class ListFacts(Struct, frozen=True):
    """A list of an observation; its rows are those of the frame table, in the order of the capture.

    ``rows`` are all of its frames, ``judged`` those whose header is captured. ``rejected`` are refusals that quote it,
    ``requests`` for boot-up, ``unanswered`` those of them that waited in vain, ``mismatches`` data with another
    checksum than its SubIndex began with. ``streams`` are those of which data is seen, by address and SubIndex.
    """

    key: ListKey
    rows: I64
    judged: I64
    requests: I64
    unanswered: I64
    rejected: I64
    mismatches: I64
    missing: Counts
    negative: Counts
    unexpected: Counts
    senders: list[IPAddress]
    readers: list[IPAddress]
    streams: list[int]


def make_list_facts(seen: Observation, key: ListKey) -> ListFacts:
    """Return what can be known of a list that is seen."""
    rows = seen.rows_of_lists[key]
    judged = rows[seen.judged[rows]]
    role = seen.role[judged]
    requests = judged[role == Role.BOOT_UP_REQUEST]

    def order(number: int) -> tuple[int, int, int]:
        entry = seen.streams[number]
        return (*address_order(seen.addresses[entry.node]), entry.subindex)

    return ListFacts(
        key=key,
        rows=rows,
        judged=judged,
        requests=requests,
        unanswered=unanswered_requests(seen, requests, rows),
        rejected=rows[seen.rejected[rows]],
        mismatches=_checksum_mismatches(seen, rows),
        missing=missing_acknowledgements(seen, rows),
        negative=negative_acknowledgements(seen, rows),
        unexpected=unexpected_acknowledgements(seen, rows),
        senders=seen.sources(judged[np.isin(role, (Role.DATA, Role.MALFORMED_DATA))]),
        readers=seen.sources(judged[np.isin(role, (Role.ACKNOWLEDGEMENT, Role.BOOT_UP_REQUEST))]),
        streams=sorted(np.unique(seen.stream[judged[seen.data[judged]]]).tolist(), key=order),
    )


def _checksum_mismatches(seen: Observation, rows: I64) -> I64:
    """Return the data telegrams whose checksum is not that of the first one of their SubIndex."""
    table = seen.table
    marked = rows[seen.data[rows] & ((table.flags[rows] & CHECKSUM_PRESENT.mask) != 0)]
    subindex = seen.subindex[marked]
    found = [np.empty(0, np.int64)]
    for number in np.unique(subindex).tolist():
        own = marked[subindex == number]
        found.append(own[table.checksum[own] != table.checksum[own[0]]])
    mismatches: I64 = np.sort(np.concatenate(found))
    return mismatches
