"""Differences are found, and told by their path."""

from __future__ import annotations

import copy

from tests.oracle.builders import telegram
from tests.oracle.compare import differences
from tests.oracle.reference import reference_report
from tests.oracle.traffic import generate
from tests.oracle.wire import A, B, Wire


def test_a_report_does_not_differ_from_itself() -> None:
    for seed in (1, 2, 3):
        report = reference_report(generate(seed, 200))
        assert differences(report, copy.deepcopy(report)) == []


def test_differences_are_told_by_their_path() -> None:
    expected = (
        Wire().data(0, 1, flags=1).data(100, 2).data(200, 4).data(300, 5).send(350, B, A, telegram(length=1)).report
    )
    actual = copy.deepcopy(expected)
    actual["capture"]["frames"] += 1
    entry = actual["lists"][0]
    entry["diag"]["nSendCount"] = 0
    del entry["diag"]["nErrorCount"]
    entry["streams"][0]["interval_ns"]["p50"] = 102
    entry["streams"][0]["interval_ns"]["p95"] = 103
    entry["streams"][0]["rate"] += 1
    entry["streams"][0]["latency_ns"]["count"] += 1
    entry["jitter"] = 9.0
    entry["nodes"].reverse()
    actual["findings"] = [row for row in actual["findings"] if row["code"] != "NV201"]
    actual["findings"].append({**expected["findings"][0], "code": "NV503"})
    found = differences(expected, actual)
    assert [line.split(": ")[0] for line in found] == [
        "capture.frames",
        "lists[udp/1202/1].diag.nSendCount",
        "lists[udp/1202/1].diag.nErrorCount",
        "lists[udp/1202/1].nodes",
        f"lists[udp/1202/1].streams[{A} 0].interval_ns.p95",
        f"lists[udp/1202/1].streams[{A} 0].rate",
        f"lists[udp/1202/1].streams[{A} 0].latency_ns.count",
        "lists[udp/1202/1].jitter",
        f"findings[NV201 udp/1202/1 {A} 0]",
    ]
