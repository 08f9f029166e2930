"""What WebVisu variables are before they are written.

Readings, where the rules leave a choice:

- the value is what came last: in the reply to a read, or in a write when that is confirmed
- once a write is asked for, nobody knows it until one of these comes, whatever becomes of that write: unless its reply
  has status 200 and says something else than `|0|`. Then it was not done, and all is as if nobody had asked for it
- nor does anybody know that of any variable of a controller once a request to it is cut, or bytes of a client are
  missing that count as a page's there and then: those may have been a write
"""

from __future__ import annotations

from collections import defaultdict

from tests.oracle.rules.visu_body import Address, Asked
from tests.oracle.rules.visu_talk import Home


class Values:
    """The values of all controllers; all that happens to them is counted, so that it has an order."""

    def __init__(self) -> None:
        self.happened = 0
        self.replies: dict[tuple[Home, Asked], tuple[int, tuple[bytes | None, ...]]] = {}
        """The last reply to each request."""
        self.confirmed: dict[tuple[Home, Address], tuple[int, str | None]] = {}
        self.asked: dict[tuple[Home, Address], list[int]] = defaultdict(list)
        """When writes were asked for, but for those that were refused."""
        self.missing: dict[Home, int] = {}

    def tick(self) -> int:
        self.happened += 1
        return self.happened

    def read(self, home: Home, asked: Asked, values: tuple[bytes | None, ...]) -> None:
        self.replies[home, asked] = self.tick(), values

    def ask(self, home: Home, asked: Asked) -> int:
        """Take that a write is asked for; return which one it is."""
        at = self.tick()
        for entry in asked.entries:
            self.asked[home, entry.address].append(at)
        return at

    def confirm(self, home: Home, asked: Asked) -> None:
        at = self.tick()
        self.confirmed |= {(home, entry.address): (at, asked.text(entry)) for entry in asked.entries}

    def refuse(self, home: Home, asked: Asked, which: int) -> None:
        for entry in asked.entries:
            self.asked[home, entry.address].remove(which)

    def miss(self, home: Home) -> None:
        self.missing[home] = self.tick()

    def known(self, home: Home, address: Address) -> str | None:
        """Return the value of a variable, None where nobody knows it."""
        since, value = self.confirmed.get((home, address), (0, None))
        found: str | None = value
        for (node, asked), (at, values) in self.replies.items():
            for entry, one in zip(asked.entries, values, strict=False):
                if node == home and entry.address == address and at >= since:
                    since, found = at, None if one is None else one.decode("latin-1")
        return None if max([0, self.missing.get(home, 0), *self.asked[home, address]]) > since else found
