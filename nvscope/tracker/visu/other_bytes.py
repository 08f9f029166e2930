"""Other bytes: those that came again as others over connections of WebVisu pages.

What is a page's connection may be known only later. So such bytes wait, as missing ones do, until a request of a page
is told of their connection, and are told behind that; those that come later are told where they came. Where no such
request is shown, they wait for bytes of the client that came again as others and have the begin of one in them: nobody
knows whether the controller took that. What never shows either is no page's.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from msgspec import Struct, field

from dissectors.http import Side
from nvscope.tracker.pieces import ORDER_BITS, OtherBytes
from nvscope.tracker.visu.conversation import Conversation
from nvscope.tracker.visu.http_forms import What
from nvscope.tracker.visu.http_messages import HttpMessages
from nvscope.tracker.visu.messages import Kind
from nvscope.tracker.visu.plain_exchanges import Said

_KINDS = {Side.CLIENT: Kind.OTHER_BYTES, Side.SERVER: Kind.OTHER_REPLY_BYTES}
_REQUEST = re.compile(rb"(?:\A[\r\n]*|\n\r?\n)\|[01]\|[0-9]+\|")
_QUERY = re.compile(rb"GET \S*(?:READPI|WRITEPI)\?", re.IGNORECASE)


def has_request(copy: bytes) -> bool:
    """Tell whether a request of a page begins in a segment: its body, or one of an older page."""
    return bool(_REQUEST.search(copy) or _QUERY.search(copy))


class _What(IntEnum):
    """What happens to a connection; of what has one order, in its order."""

    ANEW = 0
    OPENS = 1
    OTHERS = 2


class _Happened(NamedTuple):
    order: int
    what: _What
    side: Side = Side.CLIENT
    size: int = 0
    asks: bool = False


class _Held(Struct):
    """What is known of a connection: how many bytes wait by side, and since which frame.

    ``asks``: it is a page's for what came again as others; ``is_page``: for that, or what is shown.
    """

    is_page: bool = False
    asks: bool = False
    sizes: dict[Side, int] = field(default_factory=dict)
    frames: dict[Side, int] = field(default_factory=dict)


class OtherBytesOfPages:
    """Those bytes, from one batch to the next."""

    def __init__(self) -> None:
        self._held: dict[int, _Held] = {}

    def forget(self) -> None:
        """Forget all that waits."""
        self._held.clear()

    def keep(self, numbers: Mapping[int, int]) -> None:
        """Forget all connections but some, which are numbered anew."""
        self._held = {numbers[old]: held for old, held in self._held.items() if old in numbers}

    def begin(self, others: Sequence[OtherBytes], conversations: Mapping[int, Conversation]) -> None:
        """Note which connections are those of pages in front of a batch that brings ``others``."""
        for number in {one.stream >> 1 for one in others} | self._held.keys():
            conversation = conversations.get(number)
            held = self._held.setdefault(number, _Held())
            held.is_page = held.asks or (conversation is not None and conversation.is_visu)

    def told(self, others: Sequence[OtherBytes], http: HttpMessages, said: Said) -> Said:
        """Return what is to be told with the batch, of which all else is ``said``."""
        rows: list[tuple[int, ...]] = []
        for number, happened in sorted(self._happened(others, http, said).items()):
            self._take(number, sorted(happened), rows)
        # Of those that are shown to be a page's, conversations know it.
        self._held = {number: held for number, held in self._held.items() if held.sizes or held.asks}
        kind, connection, order, size, frame = np.array(rows, np.int64).reshape(-1, 5).T
        nothing, no = np.zeros(len(rows), np.int64), np.zeros(len(rows), np.bool_)
        return Said(kind, connection, order, nothing - 1, nothing, nothing, frame, size, no)

    def _happened(
        self, others: Sequence[OtherBytes], http: HttpMessages, said: Said
    ) -> Mapping[int, list[_Happened]]:  # fmt: skip
        found: dict[int, list[_Happened]] = defaultdict(list)
        if not self._held:
            return found
        connections = np.array(sorted(self._held), np.int64)
        is_anew = np.array([form.what is What.ANEW for form in http.forms], np.bool_)[http.form]
        anew = is_anew & np.isin(http.stream >> 1, connections)
        opens = said.opens & np.isin(said.connection, connections)
        for number, order in zip((http.stream[anew] >> 1).tolist(), http.order[anew].tolist(), strict=True):
            found[number].append(_Happened(order, _What.ANEW))
        for number, order in zip(said.connection[opens].tolist(), said.order[opens].tolist(), strict=True):
            found[number].append(_Happened(order, _What.OPENS))
        for one in others:
            side = Side(one.stream & 1)
            asks = side is Side.CLIENT and has_request(one.copy)
            found[one.stream >> 1].append(_Happened(one.order, _What.OTHERS, side, one.size, asks))
        return found

    def _take(self, number: int, happened: Sequence[_Happened], rows: list[tuple[int, ...]]) -> None:
        """Take what happens to a connection, in its order; add what is told of it."""
        held, at = self._held[number], happened[0].order
        for one in happened:
            if one.order != at:
                _tell(number, at, held, rows)
            at = one.order
            if one.what is _What.ANEW:
                held = self._held[number] = _Held()
            elif one.what is _What.OPENS:
                held.is_page = True
            else:
                held.asks |= one.asks
                held.is_page |= one.asks
                held.sizes[one.side] = held.sizes.get(one.side, 0) + one.size
                held.frames.setdefault(one.side, at >> ORDER_BITS)
        _tell(number, at, held, rows)


def _tell(number: int, order: int, held: _Held, rows: list[tuple[int, ...]]) -> None:
    """Tell what waits of a connection, with an order, where that is a page's; 0 is the frame of the order."""
    if not held.is_page:
        return
    for side, size in sorted(held.sizes.items()):
        first = held.frames[side]
        rows.append((int(_KINDS[side]), number, order, size, first if first < order >> ORDER_BITS else 0))
    held.sizes.clear()
    held.frames.clear()
