"""Findings by code and place."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from tests.oracle.frame import Address
from tests.oracle.rules.keys import ListKey, Moment, node_order

SEVERITY_ORDER = ("error", "warning", "note")
SEVERITIES = {
    "NV101": "error",
    "NV102": "error",
    "NV103": "warning",
    "NV104": "note",
    "NV105": "warning",
    "NV106": "warning",
    "NV107": "note",
    "NV201": "error",
    "NV202": "warning",
    "NV203": "warning",
    "NV204": "warning",
    "NV205": "note",
    "NV206": "note",
    "NV207": "warning",
    "NV301": "error",
    "NV302": "error",
    "NV303": "note",
    "NV304": "error",
    "NV305": "error",
    "NV401": "error",
    "NV402": "error",
    "NV403": "error",
    "NV404": "warning",
    "NV504": "error",
    "NV902": "warning",
}


@dataclass
class Finding:
    code: str
    list_key: ListKey | None
    node: Address | None
    subindex: int | None
    moments: list[Moment] = field(default_factory=list)

    @property
    def order(self) -> tuple[Any, ...]:
        return (
            SEVERITY_ORDER.index(SEVERITIES[self.code]),
            self.code,
            self.list_key is not None,
            self.list_key or (),
            node_order(self.node),
            -1 if self.subindex is None else self.subindex,
        )
