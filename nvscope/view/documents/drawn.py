"""Parts of documents that are made when they are asked for: of hundreds of thousands of rows, one at a time is there.

They read like the lists and dicts that plain documents are made of (``plain``), and are equal to these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar, overload

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


Shape = Mapping[str, "Shape | None"]
"""The keys of an object, each with those of the object that is there; None where it is anything else."""


class Part(NamedTuple):
    """Some keys of rows that stand one behind the other.

    ``reads`` has for each how it is read of a row, ``shape`` of which shape it is. ``columns`` reads all of them of
    many rows of one kind: a column for each key, in place of an object of the shape those of what is in it. ``lists``:
    what is read are lists that may be long.
    """

    reads: Mapping[str, Reads]
    shape: Shape
    columns: Callable[[Sequence[Any]], list[Sequence[Any]]]
    lists: bool = False


def fields(**reads: Reads) -> Part:
    """Return a part whose values are read one by one, by key."""
    each = tuple(reads.values())
    return Part(reads, dict.fromkeys(reads), lambda rows: [[read(row) for row in rows] for read in each])


def lists(**reads: Reads) -> Part:
    """Return the same of lists that may be long."""
    return fields(**reads)._replace(lists=True)


class DrawnRow(Mapping[str, Any]):
    """An object of a document whose values are made when they are asked for, and kept as long as it is there.

    ``PARTS`` have its keys in their order, and how each is read of the row; ``READS`` and ``LISTS`` follow from them.
    """

    __slots__ = ("_known",)
    PARTS: ClassVar[Sequence[Part]] = ()
    READS: ClassVar[Mapping[str, Reads]] = {}
    LISTS: ClassVar[Sequence[str]] = ()

    def __init_subclass__(cls) -> None:
        cls.READS = {key: read for part in cls.PARTS for key, read in part.reads.items()}
        cls.LISTS = tuple(key for part in cls.PARTS if part.lists for key in part.reads)

    def __init__(self) -> None:
        self._known: dict[str, Any] | None = None

    def __getitem__(self, key: str) -> Any:
        known = self._known
        if known is None:
            known = self._known = {}
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


def plain(value: Any) -> Any:
    """Return (a part of) a document as dicts and lists."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(item) for item in value]
    return value
