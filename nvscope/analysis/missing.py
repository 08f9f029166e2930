"""What is missing of what is defined: asked of an analysis."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nvscope.findings.facts import Facts
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey
from nvscope.tracker.summary import Summary
from nvscope.view.documents.missing import Shown, missing_rows
from nvscope.view.listed import of_lists

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Analysis
    from nvscope.causes.cause import Cause
    from nvscope.definition.project import Project


def missing(
    found: Analysis, project: Project, summary: Summary, findings: Sequence[Finding], causes: Sequence[Cause] | None,
    node_names: Mapping[str, str],
) -> list[dict[str, Any]]:  # fmt: skip
    """Return what is missing of what is shown, as data: of a summary, findings and causes, None without these.

    Behind a filter, nobody knows which variables change.
    """
    whole = found.summary
    facts = Facts(found.state, whole, found.infos, whole.capture.at_ns or 0, project.limits, project.definition)
    shown = Shown(findings, causes, _keys(summary))
    values = None if found.chosen is not None else found.values
    return missing_rows(facts, found.findings, shown, values, node_names=node_names)


def missing_of_lists(
    found: Analysis, project: Project, keys: Collection[ListKey] | None, node_names: Mapping[str, str]
) -> list[dict[str, Any]]:  # fmt: skip
    """Return what is missing of lists with variables, without causes; ``keys`` are those asked for, None for all."""
    summary, findings = found.summary, found.findings
    if found.chosen is not None:
        summary, findings = found.chosen.summary(summary), found.chosen.findings
    if keys is None:
        keys = {key for key, entry in project.definition.by_key().items() if entry.variables}
    wanted = {*keys, *(key for key in _keys(summary) if key.on_any_channel in keys)}
    return missing(found, project, *of_lists(summary, findings, wanted), None, node_names)


def _keys(summary: Summary) -> set[ListKey]:
    return {entry.key for entry in summary.lists} | {entry.key for entry in summary.can.lists}
