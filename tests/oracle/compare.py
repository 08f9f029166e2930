"""What differs between a reference report and a report of the product, as readable lines.

Everything that is counted must match exactly. Percentiles come from a histogram in the product and may be a little
off; what follows from them is compared where it does not hang on that little.
"""

from __future__ import annotations

from typing import Any

import pytest

from tests.oracle.rules.findings import SEVERITIES

PERCENTILES = ("p50", "p95", "p99", "nominal")
PERCENTILE_ERROR = 0.02
ROUNDED = 0.001
"""The last digit of a rate or a percentage."""

IGNORED = {"tool", "schema", "sources", "name", "message", "hint", "extent", "status"}
"""``status`` hangs on findings that the reference does not know, too."""

LOOSE: dict[str, tuple[str, ...]] = {
    "NV205": ("first_ns", "last_ns", "frames", "frames_cut"),
    "NV206": ("first_ns", "last_ns", "frames", "frames_cut"),
    "NV504": ("first_ns", "last_ns", "frames", "frames_cut"),
}
"""Parts of a finding that the rules leave open: an absence has no telegram of its own."""

Key = tuple[Any, ...]


def differences(expected: dict[str, Any], actual: dict[str, Any]) -> list[str]:
    """Return a line for every value of the reference report that the actual one lacks or has otherwise.

    The actual report may have findings with codes that the reference does not know; any other surplus is a line.
    """
    found = compare_values("capture", expected["capture"], actual.get("capture"))
    found += compare_rows("lists", expected["lists"], actual.get("lists"), ("key",))
    found += compare_findings(expected, actual)
    return found


def compare_values(path: str, expected: Any, actual: Any) -> list[str]:
    if isinstance(expected, dict) and isinstance(actual, dict):
        if path.endswith((".interval_ns", ".latency_ns")):
            return compare_durations(path, expected, actual)
        found = []
        for key in {**expected, **actual}:
            if key in IGNORED or key.startswith("_"):
                continue
            where = f"{path}.{key}"
            if key == "lost" and expected.get("_lost_uncertain"):
                if actual.get(key) not in (None, expected["lost_claimed"]):
                    found.append(f"{where}: expected null or {expected['lost_claimed']}, got {actual.get(key)!r}")
            elif key not in actual:
                found.append(f"{where}: missing")
            elif key not in expected:
                found.append(f"{where}: surplus")
            elif key == "jitter" and expected["_jitter_uncertain"]:
                continue
            elif key in ("rate", "jitter"):
                room = ROUNDED if key == "rate" else ROUNDED + expected["_jitter_room"]
                found += compare_measured(where, expected[key], actual[key], room)
            elif key == "streams":
                found += compare_rows(where, expected[key], actual[key], ("node", "subindex"))
            elif key == "nodes":
                found += compare_rows(where, expected[key], actual[key], ("address",))
            else:
                found += compare_values(where, expected[key], actual[key])
        return found
    if type(expected) is not type(actual) or expected != actual:
        return [f"{path}: expected {expected!r}, got {actual!r}"]
    return []


def compare_measured(path: str, expected: float | None, actual: Any, room: float) -> list[str]:
    if expected is None or not isinstance(actual, float):
        return compare_values(path, expected, actual)
    return [] if abs(expected - actual) <= room else [f"{path}: expected about {expected}, got {actual}"]


def compare_rows(path: str, expected: Any, actual: Any, names: tuple[str, ...]) -> list[str]:
    """Compare two lists of dicts that are identified by the values of ``names``, their order included."""
    if not isinstance(actual, list):
        return [f"{path}: expected a list, got {actual!r}"]
    rows = {tuple(row[name] for name in names): row for row in expected}
    others = {tuple(row.get(name) for name in names): row for row in actual}
    found = [f"{path}[{shown(key)}]: missing" for key in rows if key not in others]
    found += [f"{path}[{shown(key)}]: surplus" for key in others if key not in rows]
    if len(others) != len(actual):
        found.append(f"{path}: a row occurs twice")
    common = [key for key in rows if key in others]
    if common != [key for key in others if key in rows]:
        found.append(f"{path}: order is {[shown(key) for key in others]}, expected {[shown(key) for key in rows]}")
    for key in common:
        found += compare_values(f"{path}[{shown(key)}]", rows[key], others[key])
    return found


def shown(key: Key) -> str:
    return " ".join("-" if part is None else str(part) for part in key)


def compare_durations(path: str, expected: dict[str, Any], actual: dict[str, Any]) -> list[str]:
    found = []
    for name, value in expected.items():
        if name.startswith("_"):
            continue
        where = f"{path}.{name}"
        if name not in actual:
            found.append(f"{where}: missing")
        elif name not in PERCENTILES or value is None or actual[name] is None:
            if name == "nominal" and expected["_nominal_uncertain"]:
                continue
            found += compare_values(where, value, actual[name])
        elif not close(value, actual[name]):
            found.append(f"{where}: expected about {value}, got {actual[name]}")
    found += [f"{path}.{name}: surplus" for name in actual if name not in expected]
    return found


def close(expected: int, actual: Any) -> bool:
    if not isinstance(actual, int):
        return False
    return abs(expected - actual) <= max(1, abs(expected) * PERCENTILE_ERROR)


def finding_key(finding: dict[str, Any]) -> Key:
    return finding["code"], finding["list"], finding["node"], finding["subindex"]


def compare_findings(expected: dict[str, Any], actual: dict[str, Any]) -> list[str]:
    """Compare the findings whose codes the reference knows."""
    uncertain = {tuple(key) for key in expected["_uncertain"]}

    def certain(findings: list[dict[str, Any]]) -> list[dict[str, Any]]:
        known = []
        for finding in findings:
            if finding["code"] in SEVERITIES and finding_key(finding) not in uncertain:
                loose = LOOSE.get(finding["code"], ())
                known.append({name: value for name, value in finding.items() if name not in loose})
        return known

    return compare_rows(
        "findings",
        certain(expected["findings"]),
        certain(actual.get("findings", [])),
        ("code", "list", "node", "subindex"),
    )


def with_near_latencies(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of ``sdo`` with percentiles of latencies as far as a histogram tells them."""
    latency = row["latency_ns"]
    percentiles = {
        name: None if latency[name] is None else pytest.approx(latency[name], rel=0.01) for name in ("p50", "p99")
    }
    return {**row, "latency_ns": {**latency, **percentiles}}
