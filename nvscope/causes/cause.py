"""Cause: one event or condition that explains findings, with what was checked and the one next step."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

from nvscope.causes.kind import CauseKind
from nvscope.findings.finding import Finding
from nvscope.findings.kind import Severity
from nvscope.list_key import ListKey


class Cause(Struct, frozen=True):
    """A cause of one kind; what it does not concern is empty or None.

    ``lists`` are those concerned, ``nodes`` the nodes as numbers of the summary. ``until_ns`` is None where it is still
    so at the end. ``frames`` are those of its first ten events, of ``count``. ``checked`` are facts, the deciding one
    first; ``findings`` those of which it explains most of the events. ``last_ns`` is when the last of the events was
    that it explains.
    """

    kind: CauseKind
    severity: Severity
    title: str
    next: str
    checked: tuple[str, ...] = ()
    lists: tuple[ListKey, ...] = ()
    nodes: tuple[int, ...] = ()
    channel: str | None = None
    since_ns: int | None = None
    until_ns: int | None = None
    frames: tuple[int, ...] = ()
    count: int = 0
    findings: Sequence[Finding] = ()
    last_ns: int | None = None

    @property
    def of_capture(self) -> bool:
        """Whether it concerns no list and no node: then it is about all that was captured, or about a bus."""
        return not self.lists and not self.nodes

    @property
    def frames_cut(self) -> int:
        """How many more frames there are behind those that are named; 0 where none is."""
        return max(self.count - len(self.frames), 0) if self.frames else 0
