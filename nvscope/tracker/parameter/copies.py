"""Copies: requests and replies that a capture has more than once, as where a mirror port shows frames two times.

Who asks again sends another packet, and that has another identification (RFC 791, RFC 6864). A packet with the one of
a packet before it, and all of its telegram, is that packet: it asks for nothing, answers nothing, and repeats nothing.
Where packets are not identified (by 0, as many programs on Linux do it, in IPv6, or behind options), the time tells it:
no program of a controller sends the same so soon again.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8, Bool
from dissectors.headers import IPV4_HIGH
from dissectors.transport import DatagramBatch
from nvscope.tracker.parameter.values import KEPT_BYTES

REACH_NS = 100_000_000
"""So long behind a packet comes a copy of it at the latest: a few programs give all packets the same identification."""

NEAR_NS = 500_000
"""So long of packets that are not identified."""

REACH = 256
"""A copy is one of a packet among so many messages before it."""

_HEADER_BYTES = 20
_PLAIN_IPV4, _PROTOCOL_UDP = 0x45, 17
_UDP_BYTES, _PORTS_BYTES = 8, 4
_PROTOCOL_AT, _IDENTIFICATION_AT = 9, 4
_SERVICE_BITS, _NODE_BITS = 16, 24
_MIX = np.int64(0x1E37_79B9_7F4A_7C15)


class Copies:
    """The last requests and replies, by what makes a packet the same as another one."""

    def __init__(self) -> None:
        self._last: dict[tuple[object, ...], tuple[int, int]] = {}
        self._seen = 0

    def of(self, data: U8, at: I64, datagram: DatagramBatch, word: I64, service: I64, time_ns: I64) -> Bool:
        """Tell which messages are copies; they follow those before, in the order of the capture.

        ``at`` is where their payload lies in ``data``; ``word`` and ``service`` tell most of them apart.
        """
        identification = _identifications(data, at, datagram)
        copies = np.zeros(len(at), np.bool_)
        host = (datagram.source_lo & np.uint64(0xFFFF_FFFF)).astype(np.int64)
        rows = self._looked_at(word * _MIX ^ host << _NODE_BITS ^ service << _SERVICE_BITS ^ identification)
        within_ns = np.where(identification != 0, REACH_NS, NEAR_NS)
        stop = at + np.minimum(datagram.captured_bytes, _HEADER_BYTES + KEPT_BYTES)
        ends = datagram.source_hi, datagram.source_lo, datagram.destination_hi, datagram.destination_lo
        keys = zip(*(column[rows].tolist() for column in (identification, *ends)), strict=True)
        columns = rows, at[rows], stop[rows], time_ns[rows], within_ns[rows]
        view = data.data
        for own, row, payload, end, when_ns, most_ns in zip(
            keys, *(column.tolist() for column in columns), strict=True
        ):  # fmt: skip
            ports = payload - _UDP_BYTES
            key = *own, bytes(view[ports : ports + _PORTS_BYTES]), bytes(view[payload:end])
            number = self._seen + row
            before, before_ns = self._last.pop(key, (number - REACH - 1, 0))
            copies[row] = number - before <= REACH and abs(when_ns - before_ns) <= most_ns
            self._last[key] = number, when_ns
        self._seen += len(at)
        if len(self._last) > 2 * REACH:
            self._last = {key: one for key, one in self._last.items() if self._seen - one[0] <= REACH}
        return copies

    @staticmethod
    def _looked_at(mixed: I64) -> I64:
        """Return the rows that may be alike, those that reach back in front of the batch, and those within reach."""
        count = len(mixed)
        near = np.ones(count, np.bool_)
        if count > 2 * REACH:
            near[REACH : count - REACH] = False
            order = np.argsort(mixed, kind="stable")
            same = mixed[order][1:] == mixed[order][:-1]
            near[order[1:][same]] = True
            near[order[:-1][same]] = True
        return np.flatnonzero(near)


def _identifications(data: U8, at: I64, datagram: DatagramBatch) -> I64:
    """Return what tells packets apart; 0 where nothing does."""
    ip = at - _UDP_BYTES - _HEADER_BYTES
    is_plain = (datagram.source_hi == IPV4_HIGH) & (data[ip] == _PLAIN_IPV4)
    is_plain &= data[ip + _PROTOCOL_AT] == _PROTOCOL_UDP
    named = ip + _IDENTIFICATION_AT
    return np.where(is_plain, data[named].astype(np.int64) << 8 | data[named + 1], 0)
