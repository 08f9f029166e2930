"""Causes as data: rows of ``causes`` in a report (causes.md, section 4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nvscope.causes.cause import Cause
from nvscope.tracker.summary import Summary
from nvscope.view.documents.figures import time_text
from nvscope.view.documents.verdicts import key_of


def cause_rows(summary: Summary, causes: Sequence[Cause]) -> list[dict[str, Any]]:
    """Return a row a cause, in their order; ``summary`` knows their nodes and lists."""
    keys = {entry.number: str(entry.key) for entry in summary.lists}
    keys |= {entry.number: str(entry.key) for entry in summary.can.lists}
    return [
        {
            "kind": cause.kind.name,
            "severity": cause.severity.word,
            "lists": [str(key) for key in cause.lists],
            "nodes": [summary.addresses[node] for node in cause.nodes],
            "channel": cause.channel,
            "since_ns": time_text(cause.since_ns),
            "until_ns": time_text(cause.until_ns),
            "frames": list(cause.frames),
            "frames_cut": cause.frames_cut,
            "title": cause.title,
            "checked": list(cause.checked),
            "next": cause.next,
            "findings": [
                {
                    "code": finding.code,
                    "list": key_of(finding, keys),
                    "node": None if finding.node is None else summary.addresses[finding.node],
                    "subindex": finding.subindex,
                }
                for finding in cause.findings
            ],
        }
        for cause in causes
    ]
