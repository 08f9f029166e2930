"""Requests to write that are malformed, or whose header was not captured whole: nobody knows what becomes of them."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U64
from dissectors.columns import Columns
from dissectors.netvar import Fault, Service
from nvscope.engine.told import Told


class MalformedWrites(Columns, Struct, frozen=True):
    """Such requests in the order of the capture, by their rows; columns of shape (n,).

    Requester and partner are halves of their addresses; ``parameter`` is Index and SubIndex as one.
    """

    packet: I64
    requester_hi: U64
    requester_lo: U64
    partner_hi: U64
    partner_lo: U64
    port: I64
    parameter: I64


_NOTHING, _NOBODY = np.empty(0, np.int64), np.empty(0, np.uint64)
NO_MALFORMED_WRITES = MalformedWrites(_NOTHING, _NOBODY, _NOBODY, _NOBODY, _NOBODY, _NOTHING, _NOTHING)


def malformed_writes(told: Told) -> MalformedWrites:
    """Return those of a batch."""
    rows = told.laid.parameters
    if not len(rows):
        return NO_MALFORMED_WRITES
    telegrams = told.varieties.telegrams
    part = told.varieties.part[rows.variety]
    own = np.flatnonzero(telegrams.fault[part] != Fault.NONE)
    own = own[telegrams.header["id"][part[own]] == Service.ODWriteRequest]
    if not len(own):
        return NO_MALFORMED_WRITES
    part, datagram = part[own], telegrams.datagram
    carried, variety = told.varieties.carried, rows.variety[own]
    return MalformedWrites(
        rows.packet[own], datagram.source_hi[part], datagram.source_lo[part], datagram.destination_hi[part],
        datagram.destination_lo[part], datagram.destination_port[part].astype(np.int64),
        carried.identifier[variety] << 16 | carried.subindex[variety],
    )  # fmt: skip
