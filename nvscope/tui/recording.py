"""What the screen asks of a recorder: it does not know which one that is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

from dissectors.batch import PacketBatch


class Recording(Protocol):
    """What was recorded, or is being recorded: ``path`` is the last of its ``files``, all else is of all of them.

    ``failure`` is why that ended, "" where it did not fail.
    """

    @property
    def path(self) -> str: ...

    @property
    def frames(self) -> int: ...

    @property
    def bytes(self) -> int: ...

    @property
    def files(self) -> int: ...

    @property
    def is_on(self) -> bool: ...

    @property
    def failure(self) -> str: ...


class Recorder(Protocol):
    """Writes what comes to a file, while it is on; the errors that it raises are those of files."""

    @property
    def state(self) -> Recording | None: ...

    def start(self, path: str) -> None:
        """Begin a new file."""
        ...

    def stop(self) -> Recording | None:
        """End it, if there is one."""
        ...

    def save(self, path: str, batches: Iterable[PacketBatch], channels: Sequence[str]) -> int:
        """Write batches to a new file, and return how many frames that were."""
        ...
