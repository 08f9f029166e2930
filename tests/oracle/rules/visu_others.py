"""Bytes that came again as others, as far as they are those of web visualization.

Readings, where the rules leave a choice:

- as with missing bytes, those of a connection with a request of a page count, of both directions, also those before it
- so do all of a connection that shows no such request, where one begins in a segment of the client with bytes that are
  others: at its first byte, or behind an empty line; or it asks as older pages do. Nobody knows whether the controller
  took that
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.oracle.rules.streams import Others
    from tests.oracle.rules.visu_talk import Pair, Talk

BEGIN = re.compile(rb"(?:\A|\n\r?\n)[\r\n]*\|[01]\|[0-9]+\|")
QUERY = re.compile(rb"GET [^\s?]*(?:READPI|WRITEPI)\?", re.IGNORECASE)


def note(talk: Talk, others: Others) -> bool:
    """Note bytes; return whether they ask something as a page does."""
    talk.others[others.from_client] += others.size
    asks = others.from_client and bool(BEGIN.search(others.copy) or QUERY.search(others.copy))
    talk.others_ask |= asks
    return asks


def may_be_of_page(talk: Talk) -> bool:
    return talk.had_request or talk.others_ask


def other_bytes(talks: Iterable[Talk], pair: Pair, sides: Iterable[bool] = (True, False)) -> int:
    """Return how many are told of a pair, in some directions."""
    own = [talk for talk in talks if talk.pair == pair and may_be_of_page(talk)]
    return sum(talk.others[side] for talk in own for side in sides)
