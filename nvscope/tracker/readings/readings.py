"""What readings are, and what finds them: a contract that each protocol fulfils whose values come one by one."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Hashable, Iterator, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U64, Bool
from nvscope.definition.variables import Elementary
from nvscope.engine.told import Told

LEFT_OUT = -1
"""The number of variables for which there is no room."""

MOST_AT_ONCE = 1 << 18
"""So many values are looked at in one go, and those of one message."""

_DIGITS = re.compile(r"([0-9]{1,18})")


def in_order(name: str) -> Sequence[int | str]:
    """Return what sorts names in any case, with the numbers in them as numbers."""
    return [int(part) if place % 2 else part for place, part in enumerate(_DIGITS.split(name.lower()))]


class ReadVariable(Protocol):
    """A variable of which readings are; ``list`` is what stands in the place of the key of a list.

    ``is_secret``: it is a password, or may be one. ``lasts``: only changes of it are stored, and in between it stays
    as it is.
    """

    name: str

    @property
    def list(self) -> str: ...

    @property
    def type(self) -> str:
        """What its type is called; '' where nobody says it."""
        ...

    @property
    def is_secret(self) -> bool: ...

    @property
    def lasts(self) -> bool: ...

    @property
    def identity(self) -> Hashable:
        """What tells it from all others, whatever it is called, and from wherever captures are read."""
        ...

    @property
    def order(self) -> tuple[Any, ...]:
        """What variables of one protocol are sorted by."""
        ...

    @property
    def usual_form(self) -> int:
        """The ``Form`` that its values have, as far as its type says it."""
        ...

    def kind_of(self, form: int, bits: int) -> Elementary | None:
        """Return the type of a value, given by its ``Form`` and bits; None where texts are all that is known."""
        ...

    def as_shown(self, text: str) -> str:
        """Return a text that a list carries, whose characters are bytes, as this variable has the same bytes."""
        ...


Wanted = Callable[[Any], bool]
"""Tells whether a variable is wanted."""


class Readings(Struct, frozen=True):
    """Values, those of each variable in the order in which they came; columns of shape (n,).

    ``variable`` is a number of ``ReadValues.known``, ``row`` that of the packet. ``form`` is a ``Form``, ``bits`` are
    64 bits that are the same for equal values of a form: an int64 (WHOLE), a float64 (REAL, one zero only), of others a
    digest of the text. ``secret``: by what the variable was called then, it is a password, or may be one. Between
    values of one variable and ``stretch`` nothing was missed; None where that holds of all.

    ``text`` returns the text of a value at a place, as it came; ``called`` what a variable was called with a
    ``naming``, which is a number of whoever names variables.
    """

    variable: I64
    row: I64
    form: I64
    bits: U64
    secret: Bool
    naming: I64
    text: Callable[[int], str]
    called: Callable[[int, int], str]
    stretch: I64 | None = None

    def __len__(self) -> int:
        return len(self.variable)


class Holes(NamedTuple):
    """Where values of some variables, by number, were told that nobody can read any more.

    They are in front of packets (``row``, rising) and behind times; what changed since another one may be in them.
    """

    variables: I64
    row: I64
    after_ns: I64
    since_ns: I64

    def joined(self, other: Holes) -> Holes:
        """Return these and others of a variable, in their order."""
        row, after_ns, since_ns = (np.concatenate(both) for both in zip(self[1:], other[1:], strict=True))
        order = np.argsort(row, kind="stable")
        return Holes(self.variables, row[order], after_ns[order], since_ns[order])

    def parted(self, row: int) -> tuple[Holes, Holes]:
        """Return those in front of packets up to one, and those behind it."""
        place = int(np.searchsorted(self.row, row, "right"))
        before, behind = ([column[part] for column in self[1:]] for part in (slice(place), slice(place, None)))
        return Holes(self.variables, *before), Holes(self.variables, *behind)


class ReadValues(Protocol):
    """Finds the readings of batches that follow each other: those of wanted variables, as these are called then.

    Where a filter chooses frames, of the frames that it chooses. ``known`` are the variables seen so far, by number,
    also those that are not wanted; ``meant`` the numbers of those of which there was any reading. ``hidden`` counts
    values that are, or may be, passwords; ``left_out``: there was no room for some variables. ``title`` is what people
    call whoever tells them, ``holder`` what stands for one list. ``late_percent`` is how long after the one before a
    value is missed, of its usual interval, where each is told whether it changed or not. ``tells_gaps``: what somebody
    may have missed is told by stretches, and nobody else knows; ``missed`` counts how often that was. ``holes`` are in
    the batch read last, and ``told_ns`` is up to when each of some variables, by number, was told in it.
    """

    title: ClassVar[str]
    holder: ClassVar[str]
    late_percent: ClassVar[int]
    tells_gaps: ClassVar[bool]
    missed: int
    hidden: int
    meant: set[int]

    @property
    def known(self) -> Sequence[Any]: ...

    @property
    def left_out(self) -> bool: ...

    @property
    def holes(self) -> Sequence[Holes]: ...

    @property
    def told_ns(self) -> Sequence[tuple[I64, int]]: ...

    def of(self, told: Told, part: Any) -> Iterator[Readings]:
        """Yield the readings in what a protocol found in a batch, so many at a time that memory stays bounded."""
        ...

    def lists_of(self, part: Any, chosen: Bool) -> Collection[str]:
        """Return what stands for the lists of those packets of a batch that a mask chooses."""
        ...
