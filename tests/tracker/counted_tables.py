"""Everything that a ``Counted`` holds, and all figures that follow from it, as values that can be compared."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

from nvscope.tracker.counted import Counted
from nvscope.tracker.figures import Joins, Value, figures_of
from nvscope.tracker.joins import KEYS, NUMBERS, TABLES
from nvscope.tracker.subjects import Subject, subjects
from nvscope.tracker.summary import Summary
from nvscope.view.documents.report import report_document

Who = tuple[Any, ...]


NUMBERED = {
    "lists.errors.of_member": "lists.errors.members",
    "lists.acknowledgement.latencies.buckets": "lists.acknowledgement.latencies.keys",
    "senders.timing.unusual.rows": "senders.timing.unusual.keys",
    "buses.load.columns": "buses.load.keys",
    "buses.load.identifiers.columns": "buses.load.identifiers.keys",
    "buses.load.identifiers.left_out.rows": "buses.load.identifiers.left_out.keys",
    "buses.errors.columns": "buses.errors.channels",
    "buses.errors.all.rows": "buses.errors.all.keys",
    "buses.errors.classes.rows": "buses.errors.classes.keys",
    "buses.canopen.columns": "buses.canopen.nodes",
    "buses.canopen.sdo": "buses.canopen.nodes",
    "buses.canopen.nmt": "buses.canopen.channels",
    "buses.remotes.rows": "buses.remotes.keys",
}
"""What numbers the rows of tables that have keys of their own; in which order may depend on batches."""


def tables(counted: Counted) -> dict[str, Any]:
    """Return all columns and numbers, by path; rows of tables with keys of their own by these."""
    assert set(NUMBERED.values()) == set(KEYS)
    found: dict[str, Any] = {}
    for path, joins in TABLES.items():
        table, keys = attrgetter(path)(counted.state), NUMBERED.get(path)
        words = [word.tolist() for word in attrgetter(keys)(counted.state).words] if keys else [range(len(table))]
        for name in joins:
            if path != "senders.timing.unusual.rows" or name == "count":
                found[f"{path}.{name}"] = dict(zip(zip(*words, strict=True), table.column(name).tolist(), strict=True))
    for path in NUMBERS:
        found[path] = attrgetter(path)(counted.state)
    squares = counted.state.senders.timing.large_squares
    found["large squares"] = {stream: number for stream, number in squares.items() if number}
    return found | {"erratic": counted.erratic, "extremes": counted.extremes, "end": counted.end_ns}


def named(counted: Counted) -> Any:
    """Return the report on it and its figures, by names instead of by numbers, which may depend on batches.

    So does what a source has said of the time: that is left out.
    """
    summary = counted.summary()
    lists = {entry.number: entry.key for entry in (*summary.lists, *summary.can.lists)}
    figures = {
        (of, lists.get(number), None if node is None else summary.addresses[node], *rest): row
        for (of, number, node, *rest), row in all_figures(summary).items()
    }
    document = report_document(summary, [], [])
    document["capture"]["until_ns"] = None
    return figures, document, counted.extremes


def who(subject: Subject) -> Who:
    return subject.of, subject.list, subject.node, subject.subindex, subject.channel


def all_figures(summary: Summary, *joins: Joins) -> dict[Who, dict[str, Value]]:
    """Return all figures of all subjects, or those that join in one of these ways."""
    return {
        who(one): {
            figure.name: figure.read(one.measured)
            for figure in figures_of(one.of)
            if not joins or figure.joins in joins
        }
        for one in subjects(summary)
    }
