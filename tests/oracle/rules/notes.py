"""Notes: what the rules come to while frames pass: lists, their error events, and findings."""

from __future__ import annotations

from tests.oracle.frame import Address
from tests.oracle.rules.errors import ErrorEvent
from tests.oracle.rules.findings import Finding
from tests.oracle.rules.keys import ListKey, Moment, StreamKey
from tests.oracle.rules.lists import List


class Notes:
    """Lists and findings by key; every rule adds to them.

    ``uncertain`` names findings that hang on a percentile: code, list, node and SubIndex.
    """

    def __init__(self) -> None:
        self.lists: dict[ListKey, List] = {}
        self.findings: dict[tuple[str, ListKey | None, Address | None, int | None], Finding] = {}
        self.uncertain: list[list[str | int]] = []

    def list_of(self, key: ListKey) -> List:
        """Return the list of a key, a new one where none is known."""
        if key not in self.lists:
            self.lists[key] = List()
        return self.lists[key]

    def find(
        self, code: str, key: ListKey | None, node: Address | None, subindex: int | None, moment: Moment
    ) -> Finding:
        entry = self.findings.setdefault((code, key, node, subindex), Finding(code, key, node, subindex))
        entry.moments.append(moment)
        return entry

    def error(
        self, key: ListKey, name: str, node: Address | None, time: int, frame: int, *, at_deadline: bool = False
    ) -> None:
        self.lists[key].errors.append(ErrorEvent(name, node, time, at_deadline, frame))

    def doubt(self, code: str, at: StreamKey) -> None:
        self.uncertain.append([code, str(at.list_key), str(at.node), at.subindex])
