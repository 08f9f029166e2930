"""The catalogue of checks: one table, of which rules, their schema, and what explains them come."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from nvscope.check.check import Check
from nvscope.check.checks import (
    answers,
    baseline,
    buses,
    counters,
    expressions,
    findings,
    presence,
    shapes,
    timing,
    transactions,
    variables,
    writes,
)

CATALOGUE: Mapping[str, Check] = MappingProxyType(
    {
        one.name: one
        for one in (
            *timing.CHECKS,
            *presence.CHECKS,
            *counters.CHECKS,
            *answers.CHECKS,
            *transactions.CHECKS,
            *writes.CHECKS,
            *shapes.CHECKS,
            *variables.CHECKS,
            *expressions.CHECKS,
            *findings.CHECKS,
            *buses.CHECKS,
            *baseline.CHECKS,
        )
    }
)
"""All checks by name, in the order in which they are told."""
