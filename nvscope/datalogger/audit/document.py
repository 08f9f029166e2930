"""The audit for programs: a document of schema ``nvscope.audit/1``."""

from __future__ import annotations

import math
from typing import Any

from nvscope.datalogger.audit.audit import Audit, AuditedFile, AuditedTable
from nvscope.datalogger.audit.finding import Finding
from nvscope.datalogger.audit.time_strip import Mark
from nvscope.datalogger.audit.values import Figures, Value
from nvscope.version import head
from nvscope.view.escape import visible

SCHEMA = "nvscope.audit/1"


def document(audit: Audit) -> dict[str, Any]:
    """Return the document; times are texts of nanoseconds since 1970, as everywhere."""
    return {
        **head(SCHEMA),
        "files": [_file(one) for one in audit.files],
        "tables": [_table(one) for one in audit.tables],
        "findings": [_finding(one) for one in audit.findings],
        "notes": [visible(note) for note in audit.notes],
        "findings_left_out": audit.left_out,
    }


def _file(file: AuditedFile) -> dict[str, Any]:
    return {
        "path": visible(file.path),
        "series": visible(file.series),
        "number": file.number,
        "status": file.status,
        "size_bytes": file.size_bytes,
        "rows": file.rows if file.status != "unreadable" else None,
        "what": visible(file.what) or None,
        "next_step": file.next_step or None,
        "notes": [visible(note) for note in file.notes],
        "faults": file.faults,
        "damages": [
            {
                "page": damage.page,
                "pages": damage.pages,
                "what": damage.harm.value,
                "lost": damage.lost,
                "rows": list(damage.rows),
                "after_row": damage.after,
                "until_row": damage.until,
                "partly": damage.partly,
            }
            for damage in file.damages
        ],
    }


def _table(table: AuditedTable) -> dict[str, Any]:
    audit = table.audit
    return {
        "series": visible(table.series),
        "files": [visible(path) for path in table.files],
        "table": visible(audit.table.name),
        "only_changes": audit.table.only_changes,
        "time_formats": sorted(audit.forms),
        "rows": audit.rows,
        "rows_without_time": audit.untimed,
        "first_ns": _time(audit.coverage.first_ns),
        "last_ns": _time(audit.coverage.last_ns),
        "tasks": audit.task_count,
        "interval_ns": audit.interval_ns,
        "covered": audit.covered,
        "missing_ns": audit.coverage.missing_ns,
        "gaps_told": audit.coverage.gaps[Mark.TOLD],
        "gaps_not_told": audit.coverage.gaps[Mark.GAP],
        "gaps_unread": audit.coverage.gaps[Mark.UNREAD],
        "restarts": audit.restarts,
        "variables": [
            _variable(one.name, one.declared, figures)
            for one, figures in zip(audit.table.variables, audit.figures, strict=True)
        ],
    }


def _variable(name: str, declared: str, figures: Figures) -> dict[str, Any]:
    return {
        "name": visible(name),
        "declared": visible(declared),
        "stored": figures.stored,
        "changes": figures.changes,
        "rows": figures.rows,
        "unknown_rows": figures.unknown,
        "first": _value(figures.first),
        "last": _value(figures.last),
        "least": _value(figures.least),
        "greatest": _value(figures.greatest),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "code": finding.kind.code,
        "name": finding.kind.name,
        "severity": finding.severity.word,
        "file": visible(finding.file),
        "table": None if finding.table is None else visible(finding.table),
        "variable": None if finding.variable is None else visible(finding.variable),
        "count": finding.count,
        "rows": list(finding.rows),
        "rows_cut": finding.rows_cut,
        "first_ns": _time(finding.first_ns),
        "last_ns": _time(finding.last_ns),
        "message": visible(finding.message),
        "hint": finding.next_step,
    }


def _time(time_ns: int | None) -> str | None:
    return None if time_ns is None else str(time_ns)


def _value(value: Value) -> int | float | str | None:
    """Return a value as JSON has it; bytes as hexadecimal digits, and numbers beyond all others as texts."""
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
