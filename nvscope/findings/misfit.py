"""Misfit: how a telegram differs from the definition of its list, as data and in words."""

from __future__ import annotations

from typing import NamedTuple

from msgspec import Struct

from nvscope.units import count_of


class Shape(NamedTuple):
    """Items of a telegram, and the bytes of its variables."""

    items: int
    size_bytes: int

    @property
    def in_words(self) -> str:
        return f"{count_of(self.items, 'item')} in {count_of(self.size_bytes, 'byte')}"


class Misfit(Struct, frozen=True):
    """How the last telegram of a SubIndex differs from the only definition of its list.

    ``telegrams`` are those of the streams that are told about, ``telegrams_defined`` how many SubIndexes the definition
    has. ``defined`` is None where it has none of this number, and equals ``sent`` where the last telegram fits again.
    ``variable`` at ``byte`` of the data is the first that cannot be there, or, where more is sent, the last one, with
    ``byte`` its end; '' and None where neither can be told. ``after_change`` is a sentence: after which one change the
    definition would fit, '' where none is known.
    """

    subindex: int
    telegrams: int
    telegrams_defined: int
    sent: Shape
    defined: Shape | None
    variable: str = ""
    byte: int | None = None
    after_change: str = ""

    @property
    def shift_bytes(self) -> int:
        """How many bytes more are sent than defined; less than 0: so many are missing."""
        return self.sent.size_bytes - self.defined.size_bytes if self.defined else 0

    @property
    def where(self) -> str:
        """Where the telegram begins to differ, in words; '' where that cannot be told."""
        if self.defined is None or self.sent == self.defined:
            return ""
        if not self.shift_bytes:
            return "other variables of the same size together"
        differ = count_of(abs(self.shift_bytes), "byte")
        if self.shift_bytes > 0:
            return f"{differ} more than up to the end of {self.variable}"
        if not self.variable:
            return ""
        return f"{self.variable} at byte {self.byte} is the first that cannot be there, {differ} short"
