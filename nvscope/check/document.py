"""Verdicts as data: schema ``nvscope.check/1``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from nvscope.check.deciding import Decided
from nvscope.check.run import Checked
from nvscope.check.verdict import Judged, Verdict, worst_of_rules
from nvscope.version import head
from nvscope.view.documents.figures import time_text

SCHEMA = "nvscope.check/1"


def document(found: Checked) -> dict[str, Any]:
    """Return all verdicts, rules in the order of their files, subjects as lists and streams are."""
    return {
        **head(SCHEMA),
        "capture": found.scene.document["capture"],
        "verdict": worst_of_rules([one.verdict for one in found.decided]).value,
        "counts": {
            verdict.value: len(found.of(verdict)) for verdict in (Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE)
        },
        "rules": [_rule(one) for one in found.decided],
    }


def _rule(decided: Decided) -> Mapping[str, Any]:
    rule = decided.rule
    return {
        "id": rule.id,
        "check": rule.check.name,
        "severity": rule.severity,
        "verdict": decided.verdict.value,
        "description": rule.description,
        "file": rule.path,
        "line": rule.line,
        "subjects": [_subject(one) for one in decided.subjects],
    }


def _finite(value: float | None) -> float | None:
    """Return a value as JSON has it, which knows neither infinity nor NaN."""
    return value if value is not None and math.isfinite(value) else None


def _subject(judged: Judged) -> Mapping[str, Any]:
    return {
        "list": None if judged.list is None else str(judged.list),
        "node": judged.node,
        "subindex": judged.subindex,
        "variable": judged.variable,
        "channel": judged.channel,
        "protocol": judged.protocol,
        "partner": judged.partner,
        "port": judged.port,
        "verdict": judged.verdict.value,
        "reason": judged.reason,
        "worst": _finite(judged.worst),
        "limit": judged.limit,
        "margin": _finite(judged.margin),
        "margin_percent": _finite(judged.margin_percent),
        "unit": judged.unit,
        "count": judged.count,
        "first_ns": time_text(judged.first_ns),
        "frames": list(judged.frames),
        "frames_cut": max(judged.count - len(judged.frames), 0) if judged.frames else 0,
    }
