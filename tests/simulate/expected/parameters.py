"""What a report must say of the Parameter Manager: what the rules of the tests say of the frames themselves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from tests.oracle.frame import Frame
from tests.oracle.rules.parameter import Value, Write, findings_of, observed, rows_of

_SHOWN_BYTES = 8


@dataclass(frozen=True)
class ExpectedOfParameters:
    """Rows of ``sdo`` and ``sdo_writes``, and findings by code, who asks and what is asked for."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    writes: list[dict[str, Any]] = field(default_factory=list)
    findings: list[dict[str, Any]] = field(default_factory=list)


def expected_of_parameters(frames: Iterable[Frame]) -> ExpectedOfParameters:
    """Return what is to be said where no project has names and types."""
    known = observed(frames)
    findings = [
        {"code": code, "list": None, "node": node, "subindex": None, "variable": variable, "count": count}
        for code, node, variable, count, *_ in findings_of(known)
    ]
    return ExpectedOfParameters(rows_of(known), [_row(one) for one in known.writes], findings)


def _row(one: Write) -> dict[str, Any]:
    old = {"old": None, "old_text": None, "old_bytes": None} if one.old is None else _value("old", one.old)
    return {
        "time_ns": str(one.time), "frame": one.frame, "requester": one.requester, "requester_name": None,
        "partner": one.partner, "partner_name": None, "port": one.port, "index": one.index, "subindex": one.subindex,
        "name": None, "type": None, **old, **_value("new", one.new), "outcome": one.outcome, "error": one.error,
        "answer_frame": one.answer,
    }  # fmt: skip


def _value(name: str, value: Value) -> dict[str, Any]:
    text = value.data[:_SHOWN_BYTES].hex(" ")
    if value.size > len(value.data[:_SHOWN_BYTES]):
        text = f"{text} … ({value.size} bytes)".strip()
    return {name: value.data.hex(), f"{name}_text": text or "no bytes", f"{name}_bytes": value.size}
