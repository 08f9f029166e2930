"""A diagnosis as data: times are decimal strings of nanoseconds, since JavaScript cannot hold them as numbers."""

from __future__ import annotations

from typing import Any

from nvscope.tracker.counters import DIAGNOSIS
from nvscope.tracker.diagnosis import Diagnosis


def time_text(time_ns: int | None) -> str | None:
    """Return an absolute time as the report has it."""
    return None if time_ns is None else str(time_ns)


def diagnosis_row(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the components of a diagnosis by name."""
    values = {component.name: getattr(diagnosis, component.name) for component in DIAGNOSIS}
    return values | {c.name: time_text(values[c.name]) for c in DIAGNOSIS if c.unit == "ns"}
