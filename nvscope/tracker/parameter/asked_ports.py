"""On which ports nodes ask each other for parameters: what a reply is to is not told by its own ports alone."""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8, U64, Bool
from dissectors.keys import KeyTable, first_rows_from
from dissectors.netvar import PORT

_UNASKED, _BEFORE = -1, -1
_UDP_BYTES = 8


class AskedPorts:
    """The ports on which each requester has asked each partner so far, and which of them last.

    A sender is its address: a reply may come from any port, and go to any. It is to a request on the port it comes
    from, if its receiver has asked its sender on that; else on the one it goes to; else on the one asked on last. Of
    one who never asked, nobody knows: it is the usual port where that is one of its two, else the lower one.
    """

    def __init__(self) -> None:
        self._ends = KeyTable(4)
        self._ports = KeyTable(5)
        self._latest = np.empty(0, np.int64)

    def ports(self, most: int, ends: list[U64], asks: Bool, source: I64, destination: I64) -> I64:
        """Return the ports of requests and replies that follow those asked for before, in the order of the capture.

        ``ends`` are the halves of the addresses of requester and partner; of ``most`` of these, and of their ports,
        something is known.
        """
        request, reply = np.flatnonzero(asks), np.flatnonzero(~asks)
        before = len(self._ports)
        own = [word[request] for word in ends]
        asked = self._ends.numbers_within(most, *own)
        number = self._ports.numbers_within(most, *own, destination[request].view(np.uint64))
        self._latest = np.append(self._latest, np.full(len(self._ends) - len(self._latest), _UNASKED))
        port = destination.copy()
        if len(reply):
            since = np.full(len(self._ports) + 1, _BEFORE)
            fresh = first_rows_from(number, before, len(self._ports))
            since[number[fresh]] = request[fresh]
            theirs = [word[reply] for word in ends]

            def is_asked(which: I64) -> Bool:
                found = self._ports.find(*theirs, which[reply].view(np.uint64))
                told: Bool = (found >= 0) & (since[found] < reply)
                return told

            usual = (source[reply] == PORT) | (destination[reply] == PORT)
            unasked = np.where(usual, PORT, np.minimum(source[reply], destination[reply]))
            latest = self._latest_before(self._ends.find(*theirs), reply, asked, request, destination)
            found = np.where(latest == _UNASKED, unasked, latest)
            found = np.where(is_asked(destination), destination[reply], found)
            port[reply] = np.where(is_asked(source), source[reply], found)
        known = asked >= 0
        # Assigned in order, so that the last one is what stays.
        self._latest[asked[known]] = destination[request][known]
        return port

    def _latest_before(self, ends: I64, reply: I64, asked: I64, request: I64, destination: I64) -> I64:
        """Return the port on which the receiver of each reply asked its sender last, -1 where it never did."""
        latest = np.append(self._latest, _UNASKED)[ends]
        if not len(request):
            return latest
        order = np.lexsort((request, asked))
        span = int(max(request[-1], reply[-1])) + 1
        place = np.searchsorted(asked[order] * span + request[order], ends * span + reply) - 1
        last = order[np.maximum(place, 0)]
        is_here = (place >= 0) & (ends >= 0) & (asked[last] == ends)
        return np.where(is_here, destination[request[last]], latest)


def source_ports(data: U8, at: I64) -> I64:
    """Return the ports that datagrams come from; ``at`` is where their payloads begin."""
    ports = at - _UDP_BYTES
    return data[ports].astype(np.int64) << 8 | data[ports + 1].astype(np.int64)
