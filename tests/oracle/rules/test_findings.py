"""The order of findings."""

from __future__ import annotations

from tests.oracle.builders import telegram
from tests.oracle.wire import ALL, A, Wire


def test_findings_are_sorted_by_severity_first() -> None:
    wire = Wire().send(0, A, ALL, telegram(flags=8)).send(1, A, ALL, telegram(7)).send(2, A, ALL, telegram(length=1))
    assert [finding["code"] for finding in wire.report["findings"]] == ["NV102", "NV103", "NV104"]
    assert [finding["severity"] for finding in wire.report["findings"]] == ["error", "warning", "note"]
