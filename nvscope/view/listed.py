"""What is left of a report of which only some lists are asked for."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from msgspec.structs import replace

from nvscope.causes.cause import Cause
from nvscope.findings.finding import Finding
from nvscope.list_key import ListKey, told_of
from nvscope.tracker.summary import Summary


def names_of_seen_lists(
    summary: Summary, findings: Sequence[Finding], names: Mapping[ListKey, str]
) -> list[tuple[ListKey, str]]:
    """Return the lists that a report has, and those that findings miss, with their names ("" without one)."""
    keys = [*(entry.key for entry in summary.lists), *(entry.key for entry in summary.can.lists)]
    missed = [finding.key for finding in findings if finding.key is not None]
    return [(key, told_of(names, key) or "") for key in dict.fromkeys([*keys, *missed])]


def of_lists(
    summary: Summary, findings: Sequence[Finding], wanted: Collection[ListKey]
) -> tuple[Summary, list[Finding]]:
    """Return a summary with some lists alone, and the findings on these and on the captures as a whole."""
    lists = [entry for entry in summary.lists if entry.key in wanted]
    on_can = [entry for entry in summary.can.lists if entry.key in wanted]
    numbers = {entry.number for entry in lists} | {entry.number for entry in on_can}

    def concerns(finding: Finding) -> bool:
        if finding.list_number is not None:
            return finding.list_number in numbers
        if finding.key is not None:
            return finding.key in wanted
        return bool(numbers & set(finding.lists)) or finding.kind.of_capture

    left = replace(summary, lists=lists, can=replace(summary.can, lists=on_can))
    return left, [finding for finding in findings if concerns(finding)]


def causes_of_lists(causes: Sequence[Cause], wanted: Collection[ListKey]) -> list[Cause]:
    """Return the causes that concern some lists, and those that concern no list and no node alone."""
    return [cause for cause in causes if cause.of_capture or any(key in wanted for key in cause.lists)]
