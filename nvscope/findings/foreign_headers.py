"""Headers that are none of a controller: how long they are, told by where a number is that fits as Length."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

from dissectors.netvar import HEADER
from nvscope.tracker.length_fields import LengthField

if TYPE_CHECKING:
    from nvscope.findings.facts import Facts

LEAST_TELEGRAMS = 3
LEAST_PERCENT = 90
"""So many telegrams of a sender, and so many in a hundred, have a header that is none: it is no accident."""

_LENGTH_OFFSET = HEADER.offset_of("length")
_MOST_SHIFT = 8
_KNOWN_SENDERS = {(13, -2): "a public npm sender ('netvar'), for lists that are not packed"}
"""By where their Length is, and by how much the payload is longer than it says."""


class ForeignHeader(NamedTuple):
    """A header that would fit, and in words what is wrong with it; ``size_bytes`` is its own, or as it should be."""

    size_bytes: int
    words: str

    @property
    def has_other_size(self) -> bool:
        """Whether it is shorter or longer than that of a controller."""
        return self.size_bytes != HEADER.size_bytes


def is_foreign(malformed: int, telegrams: int) -> bool:
    """Tell whether so many of a sender's telegrams are malformed that its header is another one."""
    return malformed >= LEAST_TELEGRAMS and 100 * malformed >= LEAST_PERCENT * telegrams


def telegrams_of(facts: Facts, places: Collection[tuple[int, int]]) -> dict[tuple[int, int], int]:
    """Return how many telegrams of lists some nodes sent, of any service, by number of list and node.

    Lists of which the limit has left out some are not told.
    """
    found = {place: 0 for place in places if not facts.misses_data(place[0])}
    flows = facts.state.lists.flows
    for number, node, count in zip(*(flows.column(name).tolist() for name in ("list", "source", "count")), strict=True):
        if (number, node) in found:
            found[number, node] += count
    return found


def foreign_header(facts: Facts, list_number: int, node: int) -> ForeignHeader | None:
    """Return the header that a sender of a list writes instead; None where nothing fits nearly all its telegrams."""
    fields = facts.state.lists.length_fields
    telegrams = fields.telegrams_of(list_number, node)
    if telegrams < LEAST_TELEGRAMS:
        return None
    found = [
        field for field in fields.fields_of(list_number, node, -(-LEAST_PERCENT * telegrams // 100))
        if field.offset == _LENGTH_OFFSET or abs(field.difference) <= _MOST_SHIFT
    ]  # fmt: skip
    return _header(min(found, key=_oddity)) if found else None


def _oddity(field: LengthField) -> tuple[bool, int, int, int]:
    """Return by how much a number is unlike a Length: of several, the least odd is taken for it."""
    known = (field.offset, field.difference) in _KNOWN_SENDERS
    return not known, abs(field.offset - _LENGTH_OFFSET), abs(field.difference), field.offset


def _header(field: LengthField) -> ForeignHeader:
    size = HEADER.size_bytes
    if field.offset == _LENGTH_OFFSET and field.difference == size:
        return ForeignHeader(size, f"Length counts the data alone, without the {size} bytes of the header")
    shift = field.offset - _LENGTH_OFFSET
    own_bytes = size + (field.difference or shift)
    known = _KNOWN_SENDERS.get((field.offset, field.difference))
    whose = f", as that of {known}" if known else ""
    return ForeignHeader(own_bytes, f"a header of {own_bytes} bytes in place of {size} would fit{whose}")
