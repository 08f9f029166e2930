"""Readers that nobody saw: what is delivered to nodes of which a project says that they read a list."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import pytest

from nvscope.findings.judge import judge
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests.oracle.builders import ACKNOWLEDGEMENT, MILLISECOND, START, data_frame, telegram
from tests.oracle.traffic import generate
from tests.packets import batch_of, tracked

PRESS, HMI, ROBOT, ALL = "10.0.0.1", "10.0.0.2", "10.0.0.3", "255.255.255.255"


def at(number: int) -> int:
    return START + number * 50 * MILLISECOND


FRAMES = [
    data_frame(at(0), PRESS, ALL, telegram(list_id=7, counter=0)),
    data_frame(at(1), PRESS, ALL, telegram(list_id=7, counter=1)),
    data_frame(at(2), ROBOT, ALL, telegram(list_id=7, counter=0)),
    data_frame(at(3), PRESS, ROBOT, telegram(list_id=7, counter=2)),
    data_frame(at(4), PRESS, ALL, telegram(list_id=7, counter=5), port=1300),
    data_frame(at(5), ROBOT, PRESS, telegram(ACKNOWLEDGEMENT, list_id=7, counter=2)),
]


def lists(**readers: Collection[tuple[int | None, int]]) -> dict[str, Any]:
    """Return the lists of the report by key; readers are named as ``hmi`` and the like."""
    nodes = {"press": PRESS, "hmi": HMI, "robot": ROBOT, "panel": "fe80::9", "first": "0.0.0.1"}
    state = tracked([batch_of(FRAMES)])
    summary = summarize(state, readers={nodes[name]: wanted for name, wanted in readers.items()})
    document = report_document(summary, judge(state, summary=summary), [])
    return {entry["key"]: entry for entry in document["lists"]}


def received(entry: dict[str, Any]) -> dict[str, tuple[int, int, str | None]]:
    """Return by address what nodes received and would write, and when they did last."""
    return {
        node["address"]: (diag["nReceiveCount"], diag["nWriteCount"], diag["tLastReceive"])
        for node in entry["nodes"]
        for diag in [node["diag"]]
    }


def test_a_reader_that_never_sends_receives_every_broadcast() -> None:
    entry = lists(hmi=[(1202, 7)])["udp/1202/7"]
    assert entry["readers"] == [HMI, ROBOT]
    assert received(entry) == {
        PRESS: (1, 0, str(at(5))), HMI: (3, 3, str(at(2))), ROBOT: (3, 3, str(at(3))),
    }  # fmt: skip


def test_a_sender_that_reads_receives_the_broadcasts_of_others() -> None:
    entry = lists(press=[(None, 7)])["udp/1202/7"]
    assert entry["readers"] == [PRESS, ROBOT]
    assert received(entry)[PRESS] == (2, 1, str(at(5)))


@pytest.mark.parametrize(
    ("wanted", "keys"),
    [
        ([(None, 7)], {"udp/1202/7", "udp/1300/7"}),
        ([(1300, 7)], {"udp/1300/7"}),
        ([(1300, 7), (1202, 7)], {"udp/1202/7", "udp/1300/7"}),
        ([(1202, 8), (None, 9)], set()),
    ],
)
def test_which_lists_a_reader_reads(wanted: list[tuple[int | None, int]], keys: set[str]) -> None:
    assert {key for key, entry in lists(hmi=wanted).items() if HMI in entry["readers"]} == keys


def test_readers_stand_in_the_order_of_their_addresses() -> None:
    entry = lists(panel=[(None, 7)], hmi=[(None, 7)], first=[(None, 7)])["udp/1202/7"]
    assert entry["readers"] == ["0.0.0.1", HMI, ROBOT, "fe80::9"]
    assert list(received(entry)) == ["0.0.0.1", PRESS, HMI, ROBOT, "fe80::9"]


@pytest.mark.parametrize("seed", range(8))
def test_to_name_readers_that_were_seen_changes_nothing(seed: int) -> None:
    state = tracked([batch_of(generate(seed))])
    plain = summarize(state)
    readers: dict[str, list[tuple[int | None, int]]] = {}
    for entry in plain.lists:
        for node in entry.readers:
            readers.setdefault(plain.addresses[node], []).append((int(entry.key.port), entry.key.identifier))
    assert summarize(state, readers=readers) == plain
