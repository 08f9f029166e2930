"""Columns: a table as a record, each of whose fields is an array with one entry a row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Self

import numpy as np

from dissectors.batch import I64, Bool


class Columns:
    """A record whose fields are its columns, all of shape (n,).

    A subclass that makes its columns when they are asked for has its own ``__len__`` and ``take``: its constructor is
    not given them.
    """

    __slots__ = ()
    # Of records and dataclasses: the names of the fields that its constructor takes, in this order.
    __match_args__: ClassVar[tuple[str, ...]]

    def __len__(self) -> int:
        return len(getattr(self, type(self).__match_args__[0]))

    def take(self, rows: I64 | Bool) -> Self:
        """Return the rows at the given positions or where the mask is set; all of them are not copied."""
        if rows.dtype == np.bool_ and rows.all():
            return self
        made: Callable[..., Self] = type(self)
        return made(*[getattr(self, name)[rows] for name in type(self).__match_args__])

    @classmethod
    def stacked(cls, parts: Sequence[Any]) -> Self:
        """Return the rows of some parts, of which each has at least these columns, one part behind the other.

        Where all rows are those of one part, they are not copied.
        """
        made: Callable[..., Self] = cls
        parts = [part for part in parts if len(part)] or parts[:1]
        if len(parts) == 1 and type(parts[0]) is cls:
            only: Self = parts[0]
            return only
        return made(*[np.concatenate([getattr(part, name) for part in parts]) for name in cls.__match_args__])
