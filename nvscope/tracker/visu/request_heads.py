"""Request heads: since when the head of a request was there of which the body was still to come.

A server may answer such a request early: it refuses it, and reads the rest, or closes the connection (RFC 9112, section
9.3 and 9.6).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property

import numpy as np

from dissectors.batch import I64
from nvscope.tracker.pieces import NEVER, Pieces
from nvscope.tracker.visu.http_forms import NOT_BEGUN, Form, Forms, What

EARLIER = -1
"""The order of what was there before a batch."""


class RequestHeads:
    """The heads of the requests of a batch.

    ``ends`` are where pieces end in its data, ``rests`` how many bytes of these are of earlier batches, by the first
    piece of their stream. ``begun_of`` returns where the head of the request that a connection's client has begun ends
    in the data (``HttpReader.begun_at``); it is asked when all is read.
    """

    def __init__(
        self, found: Forms, pieces: Pieces, ends: I64, rests: Mapping[int, int], begun_of: Callable[[int], int]
    ) -> None:  # fmt: skip
        self._found, self._pieces, self._ends = found, pieces, ends
        self._rests, self._begun_of = rests, begun_of

    def order_of(self, place: int, form: Form) -> int:
        """Return with which order the head was there of what was found at a place, ``NEVER`` of what has no head."""
        if form.what not in (What.WHOLE, What.CUT, What.PART, What.BROKEN) or form.head is None:
            return NEVER
        at = self._found.head_at.get(place, self._found.at[place])
        return self._order(at) if at >= 0 or place in self._found.head_at else NEVER

    def begun(self, connection: int) -> int:
        """Return the same of the request that is not whole when the batch ends, ``NEVER`` where there is none."""
        at = self._begun_of(connection)
        if at == NOT_BEGUN:
            return NEVER
        stream = 2 * connection
        run = int(np.searchsorted(self._pieces.stream, stream))
        return self._order(at) if run < len(self._pieces) and self._pieces.stream[run] == stream else EARLIER

    def _order(self, at: int) -> int:
        if at < 0:
            return EARLIER
        pieces, ends = self._pieces, self._ends
        piece = int(np.searchsorted(ends, at))
        run = int(np.searchsorted(pieces.stream, pieces.stream[piece]))
        first_new = (int(ends[run - 1]) if run else 0) + self._rests.get(run, 0)
        return EARLIER if at <= first_new else int(pieces.order[piece])


class ClientRows:
    """What happens in clients' directions in a batch, by connection; few are ever asked for.

    ``stream``, ``form`` and ``order`` are columns, by place in what was found.
    """

    def __init__(self, heads: RequestHeads, forms: Forms, stream: I64, form: I64, order: I64) -> None:
        self._heads, self._forms = heads, forms.forms
        self._stream, self._form, self._order = stream, form, order

    @cached_property
    def _by_stream(self) -> tuple[I64, I64]:
        stream, order = self._stream, self._order
        further = stream[1:] - stream[:-1]
        if ((further > 0) | ((further == 0) & (order[1:] >= order[:-1]))).all():
            return stream, np.arange(len(stream))  # nearly always: what ends where it is answered stands elsewhere
        rows = np.lexsort((order, stream))
        return stream[rows], rows

    def has_begun(self, connection: int, order: int) -> bool:
        """Tell whether in front of an order a client has begun a request that is not whole by then."""
        streams, rows = self._by_stream
        begin, end = streams.searchsorted((2 * connection, 2 * connection + 1)).tolist()
        own = rows[begin:end]
        for row in own[self._order[own].searchsorted(order, side="right") :].tolist():
            form = self._forms[int(self._form[row])]
            if form.what is not What.GAP:
                return self._heads.order_of(row, form) < order
        return self._heads.begun(connection) < order
