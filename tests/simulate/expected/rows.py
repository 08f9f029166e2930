"""Rows of expected findings: codes and places only, with a count each; sentences are a matter of the report."""

from __future__ import annotations

from collections import Counter
from typing import Any

from dissectors.batch import I64
from nvscope.findings.kind import FindingKind
from nvscope.list_key import ListKey
from nvscope.simulate.frames import IPAddress, address_order
from nvscope.simulate.observation import Observation
from nvscope.simulate.replies import Counts


class ExpectedFindings:
    """Findings by code, list, node and SubIndex, and how often each is to be found."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, ListKey | None, IPAddress | None, int | None]] = Counter()

    def add(
        self, kind: FindingKind, key: ListKey | None, node: IPAddress | None, subindex: int | None, count: int = 1
    ) -> None:
        """Expect a finding ``count`` times more; none if it is 0."""
        if count:
            self._counts[kind.code, key, node, subindex] += int(count)

    def add_uncounted(self, kind: FindingKind, key: ListKey, node: IPAddress, subindex: int) -> None:
        """Expect a finding of which the scenario does not tell how often."""
        self._counts[kind.code, key, node, subindex] += 0

    def add_rows(self, kind: FindingKind, key: ListKey | None, seen: Observation, rows: I64) -> None:
        """Expect a finding for each of the rows, at its sender."""
        for template, count in seen.by_template(rows):
            self.add(kind, key, template.source, template.subindex, count)

    def add_counts(self, kind: FindingKind, key: ListKey, counts: Counts) -> None:
        """Expect findings as often as was counted at each node and SubIndex of a list."""
        for (node, subindex), count in counts.items():
            self.add(kind, key, node, subindex, count)

    def rows(self) -> list[dict[str, Any]]:
        """Return the findings as a report has them, by code, list, node and SubIndex."""

        def order(entry: tuple[str, ListKey | None, IPAddress | None, int | None]) -> tuple[Any, ...]:
            code, key, node, subindex = entry
            address = (0, 0) if node is None else address_order(node)
            return code, () if key is None else key, address, -1 if subindex is None else subindex

        return [
            {
                "code": code,
                "list": None if key is None else str(key),
                "node": None if node is None else str(node),
                "subindex": subindex,
                "count": self._counts[code, key, node, subindex] or None,
            }
            for code, key, node, subindex in sorted(self._counts, key=order)
        ]
