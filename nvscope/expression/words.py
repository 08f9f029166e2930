"""Words: what names stand for, found one by one, in any case."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TypeVar

_T = TypeVar("_T")


class Words(Mapping[str, _T]):
    """What names stand for, as a mapping that finds names in any case.

    A name is found without going through the others: there may be more of them than fit into memory, so that what is
    iterated is the first of them, and what is not among those can be asked for all the same.
    """

    @abstractmethod
    def spelled(self, text: str) -> str | None:
        """Return the name that a text is in any case, as the mapping spells it; None where there is none."""

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self.spelled(name) == name

    def __len__(self) -> int:
        return sum(1 for _ in self)


class TableWords(Words[_T]):
    """Words of a mapping that holds all of them."""

    def __init__(self, table: Mapping[str, _T]) -> None:
        self._table = table

    def spelled(self, text: str) -> str | None:
        return text if text in self._table else self._lower.get(text.lower())

    def __getitem__(self, name: str) -> _T:
        return self._table[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    @cached_property
    def _lower(self) -> dict[str, str]:
        return {name.lower(): name for name in self._table}


def words_of(names: Mapping[str, _T]) -> Words[_T]:
    """Return names as words."""
    return names if isinstance(names, Words) else TableWords(names)
