"""Accumulator: one thing that the tracker counts, and by which key it may be split."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Protocol

from nvscope.engine.dealing import Share, SplitBy
from nvscope.engine.told import Told


class Accumulator(Protocol):
    """Counts something of all traffic in integers, so that every cut of it gives the same.

    ``SPLIT_BY`` is what frames may be dealt out by: parts that counted a share each, joined, are what counting all at
    once gives. What is of no list, such as the messages of protocols with ports of their own, goes to the first part.

    What happened, it tells (``Told.tell``): kinds of events are members of an enumeration of its own.
    """

    SPLIT_BY: ClassVar[SplitBy]

    def observe(self, told: Told) -> None:
        """Take a batch, which follows those observed so far."""
        ...

    def take(self, part: Any, share: Share) -> None:
        """Take over what a part, another one of the same class, has counted of its share."""
        ...


class ProtocolAccumulator(Accumulator, Protocol):
    """Counts a protocol that has ports of its own."""

    def summary(self) -> ProtocolSummary:
        """Return what follows from what was counted, which changes nothing."""
        ...


class ProtocolSummary(NamedTuple):
    """What follows from what an accumulator has counted: rows of its own.

    ``further`` are rows of other kinds, each with a name of its own. ``nodes`` are the halves of addresses that
    findings on it may name.
    """

    rows: Sequence[Any] = ()
    further: Mapping[str, Sequence[Any]] = MappingProxyType({})
    nodes: Sequence[tuple[int, int]] = ()


NO_SUMMARY = ProtocolSummary()
