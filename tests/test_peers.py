"""Three public senders with three habits of counting: nothing was lost, and the report does not claim otherwise."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

from nvscope.capture.open import open_source
from tests.packets import document_of, tracked

PEERS = Path(__file__).parent.parent / "captures" / "peers" / "peers.pcap"


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    return document_of(tracked(open_source([str(PEERS)])))


def test_nothing_is_called_lost(report: dict[str, Any]) -> None:
    assert "NV201" not in {finding["code"] for finding in report["findings"]}
    lost = {entry["id"]: entry["counters"]["lost"] for entry in report["lists"]}
    assert {number: lost[number] for number in (1, 7, 9, 42)} == {1: 0, 7: 0, 9: 0, 42: 0}


def test_each_sender_is_understood(report: dict[str, Any]) -> None:
    scopes = {(entry["id"], stream["counter_scope"]) for entry in report["lists"] for stream in entry["streams"]}
    assert scopes == {(1, "node-send"), (7, "node-send"), (3, "stream"), (42, "stream")}


def test_findings_are_those_that_a_person_would_name(report: dict[str, Any]) -> None:
    found = defaultdict(set)
    for finding in report["findings"]:
        found[finding["list"] or finding["node"] or "capture"].add(finding["code"])
    assert found == {
        "udp/1202/9": {"NV102"},  # headers of 18 bytes
        "udp/1202/3": {"NV207"},  # a counter that is written byte-swapped from 128 on
        "10.77.0.1": {"NV206"},
    }  # time stamps go back by up to 1 us: several queues, no clock that steps


def test_telegrams_are_all_there(report: dict[str, Any]) -> None:
    sent = {entry["id"]: entry["diag"]["nSendCount"] for entry in report["lists"]}
    assert sent == {1: 209, 3: 249, 7: 156, 9: 49, 42: 199}
    assert report["capture"]["telegrams"] == 862
    assert report["capture"]["other_frames"] == 2
