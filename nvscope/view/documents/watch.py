"""A line of what is watched: schema ``nvscope.watch/1``, one a second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nvscope.causes.cause import Cause
from nvscope.tracker.summary import Summary
from nvscope.version import head
from nvscope.view.documents.causes import cause_rows
from nvscope.view.documents.figures import time_text

SCHEMA = "nvscope.watch/1"


def watch_line(
    report: Mapping[str, Any],
    summary: Summary,
    at_ns: int | None,
    per_s: Mapping[str, float | None],
    of_all: float | None,
    new: Sequence[Cause],
    ended: Sequence[Cause],
    instead: Sequence[Cause | None],
    transactions: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """Return one line as data.

    ``report`` is that of the moment (schema ``nvscope.report/2``), ``per_s`` are telegrams a second by the key of their
    list, None where nobody knows, ``of_all`` those of all lists. ``instead`` has the cause that explains now
    what each of the ended ones did, None where it is over by itself. ``transactions`` are a row a pair of nodes of
    which one asks the other for parameters or variables; without any, nothing is told of that.
    """
    capture = report["capture"]
    return {
        **head(SCHEMA),
        "at_ns": time_text(at_ns),
        "until_ns": capture["until_ns"],
        "frames": capture["frames"],
        "telegrams": capture["telegrams"],
        "drops": capture["drops"],
        "telegrams_per_s": of_all,
        "lists": [
            {
                "key": entry["key"],
                "status": entry["status"],
                "telegrams": entry["diag"]["nSendCount"],
                "lost": entry["counters"]["lost"],
                "per_s": per_s.get(entry["key"]),
            }
            for entry in report["lists"]
        ],
        **({"transactions": list(transactions)} if transactions else {}),
        "causes_new": cause_rows(summary, new),
        "causes_ended": [
            {**row, "instead": None if heir is None else heir.title}
            for row, heir in zip(cause_rows(summary, ended), instead, strict=True)
        ],
    }
