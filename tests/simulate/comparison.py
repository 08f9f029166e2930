"""What differs between a simulation and a report on it, as readable lines.

The truth is a part of a report: what it says must be said by the report with the same value, and the findings are those
that are expected, no more and no less. A null among figures and
intervals means that nobody can know; findings that hang on such figures are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from tests.simulate.simulation import Simulation

UNKNOWABLE = {
    "lost", "gaps", "longest_gap", "duplicates", "overtaken", "restarts", "counter_scope", "count", "min", "max",
}  # fmt: skip
OF_COUNTERS = {"NV201", "NV202", "NV203", "NV204", "NV205", "NV206", "NV207"}
ONLY_IN_TRUTH = {"causes", "designed", "schema", "tool", "title", "seed", "exact"}

FindingKey = tuple[str, str | None, str | None, int | None]


def by_list(told: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is told by list, of each list of a range such as ``udp/1202/7-9`` the same; others as they are."""
    found: dict[str, Any] = {}
    for key, value in told.items():
        place, _, numbers = key.rpartition("/")
        first, _, last = numbers.partition("-")
        each = [f"{place}/{number}" for number in range(int(first), int(last) + 1)] if last else [key]
        assert found.keys().isdisjoint(each), f"{key} is told twice"
        found |= dict.fromkeys(each, value)
    return found


def differences(simulation: Simulation, report: dict[str, Any], codes: set[str]) -> list[str]:
    """Return a line for each value that differs; findings are compared for ``codes``, strictly in both directions."""
    truth = simulation.truth
    found = compare("report", truth, report)
    unknowable = {stream["node"] for entry in truth["lists"] for stream in entry["streams"] if stream["lost"] is None}
    expected, actual = (
        _counts(
            finding
            for finding in findings
            if (key := finding_key(finding))[0] in codes and not (key[0] in OF_COUNTERS and key[2] in unknowable)
        )
        for findings in (simulation.findings, report["findings"])
    )
    expected = _taken_together(expected)
    for key in sorted(expected.keys() | actual.keys(), key=str):
        if expected.get(key) != actual.get(key):
            found.append(f"finding {key}: expected {expected.get(key)}, report {actual.get(key)}")
    return found


def _counts(findings: Iterable[dict[str, Any]]) -> dict[FindingKey, int | None]:
    """Return how often each finding is there; those of several buses have one key."""
    counts: dict[FindingKey, int | None] = {}
    for finding in findings:
        key, count = finding_key(finding), finding["count"]
        before = counts.get(key)
        counts[key] = count if before is None or count is None else before + count
    return counts


def _taken_together(counts: dict[FindingKey, int | None]) -> dict[FindingKey, int | None]:
    """Return the same with what five identifiers of a CAN channel have alike, or more, as one without a list."""
    alike: dict[tuple[str, str], list[FindingKey]] = {}
    for key in counts:
        transport, _, place = (key[1] or "").partition("/")
        if transport == "can" and key[0] not in ("NV601", "NV602", "NV407"):
            alike.setdefault((key[0], place.rpartition("/")[0]), []).append(key)
    for (code, _), keys in alike.items():
        if len(keys) >= 5:
            count = sum(counts.pop(key) or 0 for key in keys)
            counts[code, None, None, None] = count + (counts.get((code, None, None, None)) or 0)
    return counts


def finding_key(finding: dict[str, Any]) -> FindingKey:
    return finding["code"], finding["list"], finding["node"], finding["subindex"]


def compare(path: str, truth: Any, report: Any) -> list[str]:
    if isinstance(truth, dict):
        found = []
        for name, value in truth.items():
            if name in ONLY_IN_TRUTH or (value is None and name in UNKNOWABLE):
                continue
            if name not in report:
                found.append(f"{path}.{name}: not in the report")
            else:
                found += compare(f"{path}.{name}", value, report[name])
        return found
    if isinstance(truth, list) and isinstance(report, list):
        if len(truth) != len(report):
            return [f"{path}: truth has {len(truth)} rows, report {len(report)}"]
        pairs = enumerate(zip(truth, report, strict=True))
        return [line for place, pair in pairs for line in compare(f"{path}[{place}]", *pair)]
    return [] if truth == report else [f"{path}: truth {truth!r}, report {report!r}"]
