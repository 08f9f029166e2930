"""Sized: a resolved type, and how much there is in it."""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from nvscope.definition.model import Flaw
from nvscope.definition.variables import Scalar, Type


class Sized(Struct, frozen=True):
    """A resolved type. ``parts`` bounds both its elements and what has to be visited to describe it.

    ``depth`` is how many types lie within it, one in another, ``characters`` what all its elements add to their names,
    ``flaws`` why it, or something in it, is not known.
    """

    type: Type
    parts: int = 1
    depth: int = 0
    characters: int = 0
    flaws: frozenset[Flaw] = frozenset()

    @property
    def unknown(self) -> bool:
        """Whether nothing is known of it, not even its size."""
        return isinstance(self.type, Scalar) and not self.type.size_bytes

    def as_one(self) -> Sized:
        """Return this type, of which nothing is known, as one of which nothing is known but that it is one element."""
        assert isinstance(self.type, Scalar)
        return replace(self, type=replace(self.type, is_one=True))
