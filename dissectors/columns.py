"""Columns: a table as a dataclass, each of whose fields is an array with one entry a row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import Field, fields
from typing import Any, ClassVar, Self

import numpy as np

from dissectors.batch import I64, Bool


class Columns:
    """A dataclass whose fields are its columns, all of shape (n,).

    A subclass that makes its columns when they are asked for has its own ``__len__`` and ``take``: its constructor is
    not given them.
    """

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def take(self, rows: I64 | Bool) -> Self:
        """Return the rows at the given positions or where the mask is set."""
        made: Callable[..., Self] = type(self)
        return made(*(getattr(self, column.name)[rows] for column in fields(self)))

    @classmethod
    def stacked(cls, parts: Sequence[Any]) -> Self:
        """Return the rows of some parts, of which each has at least these columns, one part behind the other."""
        made: Callable[..., Self] = cls
        return made(*(np.concatenate([getattr(part, column.name) for part in parts]) for column in fields(cls)))
