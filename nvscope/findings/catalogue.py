"""Every finding there can be: the rows of all themes, by code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType, ModuleType

from nvscope.findings import (
    answers,
    can,
    can_bus,
    capture,
    cob_ids,
    consistency,
    counter_takeovers,
    datalogger,
    definition,
    header,
    loss,
    parameter,
    scans,
    security,
    subnets,
    timing,
    unallowed_writes,
    visu,
    visu_disorder,
)
from nvscope.findings.kind import FindingKind

THEMES = (
    header, loss, answers, consistency, definition, timing, cob_ids, can, can_bus, parameter, visu, visu_disorder,
    capture, security, unallowed_writes, counter_takeovers, subnets, scans, datalogger,
)  # fmt: skip


def rows_of(theme: ModuleType) -> list[FindingKind]:
    """Return the rows of the catalogue that stand in a module."""
    return [value for value in vars(theme).values() if isinstance(value, FindingKind)]


def _gathered(kinds: Iterable[FindingKind]) -> Mapping[str, FindingKind]:
    by_code: dict[str, FindingKind] = {}
    for kind in sorted(kinds, key=lambda kind: kind.code):
        if by_code.setdefault(kind.code, kind) is not kind:
            raise ValueError(f"two kinds of findings have the code {kind.code}")
    return MappingProxyType(by_code)


CATALOGUE = _gathered(kind for theme in THEMES for kind in rows_of(theme))
