"""The schema of audits of DataLogger databases."""

from __future__ import annotations

from nvscope.capture.datalogger.damage import Harm
from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.kind import Severity
from tests.schemas.shapes import (
    Schema,
    document,
    duration,
    maybe,
    number,
    record,
    several,
    text,
    time,
    truth,
    whole,
    word,
)

_KINDS = [kind for kind in CATALOGUE.values() if kind.of_databases]
_ROWID = {"type": "integer"}
_VALUE = {"type": ["integer", "number", "string", "null"]}


def audit() -> Schema:
    """Return the schema of ``audit --json``."""
    damage = {
        "page": whole("the first of them, from 1; 0 where nobody knows"), "pages": whole("how many", 1),
        "what": text(f"such as: {Harm.MISSING.value}"), "lost": text("which rows that are, in words"),
        "rows": several(_ROWID, "the first ten of these, by their ids, where they are known"),
        "after_row": maybe(whole("rows behind this id are lost", None)),
        "until_row": maybe(whole("rows up to this id are lost", None)),
        "partly": truth("whether only some of the rows between these are lost"),
    }  # fmt: skip
    file = {
        "path": text(), "series": text("the file of its series that is written last"),
        "number": maybe(whole("of a closed file; null for the last one")),
        "status": word(["read", "damaged", "unreadable"]), "size_bytes": maybe(whole("unit: bytes")),
        "rows": maybe(whole("null where it is unreadable")),
        "what": maybe(text("why it is unreadable")), "next_step": maybe(text()),
        "notes": several(text(), "what people should know of its state"),
        "faults": whole("pages and places that cannot be read"),
        "damages": several(record(damage), "the first hundred of each table"),
    }  # fmt: skip
    variable = {
        "name": text(), "declared": text("the type of its column"), "stored": whole("values, NULL aside"),
        "changes": whole("values that differ from the one before"),
        "rows": whole("that could have it: those of its task; of all tasks where only changes are stored"),
        "unknown_rows": whole("those of these in which nobody knows it"), "first": _VALUE, "last": _VALUE,
        "least": _VALUE, "greatest": _VALUE,
    }  # fmt: skip
    table = {
        "series": text(), "files": several(text(), "in their order"), "table": text(),
        "only_changes": truth("storeChangesOnly"), "time_formats": several(word(["iso", "raw"])), "rows": whole(),
        "rows_without_time": whole(), "first_ns": maybe(time()), "last_ns": maybe(time("the latest")),
        "tasks": whole("groups of variables that are stored in rows of their own"),
        "interval_ns": maybe(duration("by which gaps are judged; null in tables of changes")),
        "covered": maybe(number("share of the time in which nothing is missing", 0, 1)),
        "missing_ns": duration("time in which rows are missing, of whichever task, or the logger was off"),
        "gaps_told": whole("by ConsistentDataSeries"), "gaps_not_told": whole(),
        "gaps_unread": whole("where pages or files are missing"), "restarts": whole(),
        "variables": several(record(variable), "in the order of the columns"),
    }  # fmt: skip
    finding = {
        "code": word([kind.code for kind in _KINDS]), "name": word([kind.name for kind in _KINDS]),
        "severity": word([one.word for one in Severity]), "file": text("in which the rows are"),
        "table": maybe(text()), "variable": maybe(text()), "count": whole("", 1),
        "rows": several(_ROWID, "the first ten, by their ids"), "rows_cut": whole("how many more there are"),
        "first_ns": maybe(time()), "last_ns": maybe(time()), "message": text(), "hint": text("what to do first"),
    }  # fmt: skip
    return document(
        "audit", "`nvscope audit --json`: whether databases of DataLoggers can be trusted",
        {
            "files": several(record(file), "by series, in their order"), "tables": several(record(table)),
            "findings": several(record(finding), "by series: of files, then of tables"),
            "notes": several(text(), "what people should know of all, such as that the configuration does not fit"),
            "findings_left_out": whole("how many more there are than are kept"),
        },
    )  # fmt: skip
