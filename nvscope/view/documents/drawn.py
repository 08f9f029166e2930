"""Parts of documents that are made when they are asked for: of hundreds of thousands of rows, one at a time is there.

They read like the lists and dicts that plain documents are made of (``plain``), and are equal to these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Generic, TypeVar, overload

Entry = TypeVar("Entry")
Reads = Callable[[Any], Any]
"""Given a ``DrawnRow``, returns what it has under a key."""


class Drawn(Sequence[Entry], Generic[Entry]):
    """A list of which each entry is made of one of ``sources`` when it is asked for, and not kept."""

    def __init__(self, sources: Sequence[Any], make: Callable[[Any], Entry]) -> None:
        self._sources = sources
        self._make = make

    def __len__(self) -> int:
        return len(self._sources)

    def __iter__(self) -> Iterator[Entry]:
        return map(self._make, self._sources)

    @overload
    def __getitem__(self, place: int) -> Entry: ...

    @overload
    def __getitem__(self, place: slice) -> Drawn[Entry]: ...

    def __getitem__(self, place: int | slice) -> Entry | Drawn[Entry]:
        found = self._sources[place]
        return Drawn(found, self._make) if isinstance(place, slice) else self._make(found)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or isinstance(other, str):
            return NotImplemented
        return len(self) == len(other) and all(own == one for own, one in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]  # as lists have none


class DrawnRow(Mapping[str, Any]):
    """An object of a document whose values are made when they are asked for, and kept as long as it is there.

    ``READS`` has its keys in their order, and how each is read of the row.
    """

    __slots__ = ("_known",)
    READS: ClassVar[Mapping[str, Reads]]

    def __init__(self) -> None:
        self._known: dict[str, Any] = {}

    def __getitem__(self, key: str) -> Any:
        known = self._known
        if key not in known:
            known[key] = self.READS[key](self)
        return known[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.READS)

    def __len__(self) -> int:
        return len(self.READS)

    def __contains__(self, key: object) -> bool:
        return key in self.READS

    def get(self, key: str, default: Any = None) -> Any:
        return self[key] if key in self.READS else default

    def values(self) -> list[Any]:  # type: ignore[override]  # read once, in order
        """Return all values in the order of the keys."""
        if not self._known:  # who takes all of them takes them once
            return [read(self) for read in self.READS.values()]
        return [self[key] for key in self.READS]


def plain(value: Any) -> Any:
    """Return (a part of) a document as dicts and lists."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(item) for item in value]
    return value
