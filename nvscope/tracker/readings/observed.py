"""Observed: readers of the readings of several protocols, each of which is made when its first value may come."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from nvscope.engine.told import Told


class Reader(Protocol):
    """Whatever takes what one protocol found, batch by batch; ``forget``: nobody listened for a while."""

    def observe(self, told: Told, part: Any) -> None:
        """Take what a batch brings, which follows those before."""
        ...

    def forget(self) -> None:
        """Begin anew with what comes next."""
        ...


AnyReader = TypeVar("AnyReader", bound=Reader)


class Observed(Generic[AnyReader]):
    """An observer with a reader a protocol, ``known`` by name: none before there is anything of it.

    ``makes`` are what makes one, by the names of the protocols that are read.
    """

    by_stream: ClassVar[bool] = False

    def __init__(self, makes: Mapping[str, Callable[[], AnyReader]]) -> None:
        self.makes = makes
        self.known: dict[str, AnyReader] = {}

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        for name, make in self.makes.items():
            part = told.parts.get(name)
            if part is not None:
                if name not in self.known:
                    self.known[name] = make()
                self.known[name].observe(told, part)
        if told.is_deaf:
            for reader in self.known.values():
                reader.forget()
