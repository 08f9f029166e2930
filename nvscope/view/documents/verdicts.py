"""What findings come to, as data: the status of each list, and how many lists and findings there are of each kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence

from msgspec import Struct

from nvscope.findings.finding import Finding
from nvscope.findings.kind import Severity

OK = "ok"
"""The status of a list that nothing was found on."""

SEVERITIES = tuple(severity.word for severity in sorted(Severity, reverse=True))
STATUSES = (*SEVERITIES, OK)
"""The words for severities, the worst first, and for what lists can be."""


class Verdicts(Struct, frozen=True):
    """What some findings say of lists; both by key, as reports have it. ``worst`` is that of those with any."""

    worst: Mapping[str, Severity]
    totals: Mapping[str, Mapping[str, int]]

    def status(self, key: str) -> str:
        """Return the severity of the worst finding on a list, ``ok`` where there is none."""
        found = self.worst.get(key)
        return OK if found is None else found.word


def verdicts(
    findings: Sequence[Finding], all_findings: Sequence[Finding], keys: Mapping[int, str], shown: Collection[str]
) -> Verdicts:
    """Return what findings say of the lists that a report shows, and how many of both it shows.

    Of the ``findings`` that it shows and the lists with the keys ``shown``, totals are counted; what a list is is for
    ``all_findings`` to say: one that is hidden makes no list good. ``keys`` are those of all lists, by number.
    ``totals`` counts lists by status, findings by severity, and among these the ones that are on none of the lists.
    """
    worst: dict[str, Severity] = {}
    for finding in all_findings:
        for key in keys_of(finding, keys):
            worst[key] = max(worst.get(key, finding.kind.severity), finding.kind.severity)
    beside = [one for one in findings if not one.lists and not any(key in shown for key in keys_of(one, keys))]
    lists = Counter(severity.word for key, severity in worst.items() if key in shown)
    lists[OK] = len(shown) - lists.total()
    totals = {
        "lists": {status: lists[status] for status in STATUSES},
        "findings": _by_severity(findings),
        "findings_beside_lists": _by_severity(beside),
    }
    return Verdicts(worst, totals)


def key_of(finding: Finding, keys: Mapping[int, str]) -> str | None:
    """Return the key of the list that a finding is about, None where it is about none, or about several."""
    if finding.list_number is not None:
        return keys[finding.list_number]
    return None if finding.key is None else str(finding.key)


def keys_of(finding: Finding, keys: Mapping[int, str]) -> list[str]:
    """Return the keys of all lists that a finding is about."""
    key = key_of(finding, keys)
    return [keys[number] for number in finding.lists] if key is None else [key]


def _by_severity(findings: Iterable[Finding]) -> dict[str, int]:
    counted = Counter(finding.kind.severity.word for finding in findings)
    return {word: counted[word] for word in SEVERITIES}
