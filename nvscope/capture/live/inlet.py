"""Inlet: where a live source takes its packets from: a ring, a socket, a bus."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

from dissectors.batch import PacketBatch


class Inlet(Protocol):
    """Something open that packets come in by; a source asks it, and nobody else.

    ``path`` is what people call it, ``format`` what kind of it reports name. ``channels`` are names of channels by
    number, if its packets have any. ``lag_ns`` is how long a packet may be in the kernel before ``take`` gives it out.
    ``gather_ns`` is how long packets are left there so that more of them come at once, 0 where it gathers by itself.
    ``hears_answers``: what others say to each other comes in, too, and not only what is for this machine.
    """

    path: str
    format: str
    lag_ns: int
    gather_ns: int
    hears_answers: bool

    @property
    def channels(self) -> Sequence[str]: ...

    def fileno(self) -> int:
        """Return the descriptor that has something to be read when a packet came, -1 where only ``take`` tells."""
        ...

    def take(self) -> PacketBatch | None:
        """Return the packets that are there, None without any, at once; valid until the next call of any method."""
        ...

    def is_filling(self) -> bool:
        """Return whether so much is there that it should be taken soon."""
        ...

    def drain(self) -> Iterator[PacketBatch]:
        """Let nothing in any more, and yield what the kernel took until then; each valid until the next one."""
        ...

    def drops(self) -> Mapping[str, int] | None:
        """Return how many packets were lost on the way so far, by values of ``DropsPart``; None if nobody knows."""
        ...

    def failure(self) -> str:
        """Return why nothing can come any more, '' as long as something can."""
        ...

    def has_carrier(self) -> bool:
        """Return whether there is a cable that works, as far as that can be known."""
        ...

    def close(self) -> None:
        """Close what is open; also repeatedly."""
        ...
