"""Who gets what, and which lists and nodes there are."""

from __future__ import annotations

import pytest

from tests.oracle.builders import telegram
from tests.oracle.wire import ALL, A, B, C, Wire


def test_receive_counts() -> None:
    wire = (
        Wire()
        .data(1, 1)  # broadcast: for B, a reader from frame 5 on, and for no other
        .data(2, 2, to=C)  # unicast: for C
        .data(3, 3, to="10.0.0.255")
        .send(4, A, C, telegram(length=99))  # malformed, for C
        .boot_up(5, B, A)
        .send(6, C, ALL, telegram(77))
    )
    entry = wire.only_list
    assert entry["diag"] | {"nErrorCount": 0} == {
        "nSendCount": 4,
        "tLastSend": "4",
        "nReceiveCount": 6,
        "tLastReceive": "6",
        "nWriteCount": 3,
        "sLastError": "NOERROR",
        "tLastError": None,
        "nErrorCount": 0,
        "nAcknowledges": 0,
    }
    received = {node["address"]: node["diag"]["nReceiveCount"] for node in entry["nodes"]}
    assert received == {A: 1, B: 3, C: 2}
    written = {node["address"]: node["diag"]["nWriteCount"] for node in entry["nodes"]}
    assert written == {A: 0, B: 2, C: 1}
    assert (entry["senders"], entry["readers"]) == ([A], [B])
    assert entry["counters"]["malformed"] == 2


def test_a_node_does_not_receive_its_own_broadcast() -> None:
    wire = Wire().boot_up(1, B).data(2, 1, source=B).data(3, 1)
    node = wire.node(B)
    assert node is not None
    assert (node["nReceiveCount"], node["tLastReceive"], node["nSendCount"]) == (1, "3", 1)
    assert wire.node(A) is not None


def test_a_node_without_anything_does_not_appear() -> None:
    wire = Wire().boot_up(1, B)
    assert wire.only_list["readers"] == [B]
    assert wire.only_list["nodes"] == []
    assert wire.only_list["diag"]["nReceiveCount"] == 1


def test_nodes_are_sorted_by_number() -> None:
    wire = Wire().data(0, 1, source="10.0.0.10").data(0, 1, source="10.0.0.9")
    wire.data(0, 1, source="::1", to="ff02::1")
    assert wire.only_list["senders"] == ["10.0.0.9", "10.0.0.10", "::1"]


def test_lists_are_told_apart_by_port() -> None:
    wire = Wire().data(0, 1, port=1300).data(1, 1).data(2, 1, list_id=0)
    assert [entry["key"] for entry in wire.report["lists"]] == ["udp/1202/0", "udp/1202/1", "udp/1300/1"]


@pytest.mark.parametrize("service", [1, 2, 3, 4, 20, 24, 28, 100])
def test_the_parameter_manager_has_no_lists(service: int) -> None:
    wire = Wire().send(0, A, B, telegram(service, 0x2000)).send(1, A, B, telegram(service, 0x2000, length=3))
    assert wire.report["lists"] == []
    assert wire.report["capture"]["telegrams"] == 2
    (finding,) = wire.report["findings"]
    assert (finding["code"], finding["list"], finding["node"], finding["subindex"]) == ("NV102", None, A, None)


def test_a_real_boot_up_request() -> None:
    report = Wire().send(0, A, ALL, bytes.fromhex("002d5333060000000a0002000100140000000000")).report
    assert (report["lists"][0]["key"], report["lists"][0]["readers"]) == ("udp/1202/10", [A])
    assert report["lists"][0]["counters"]["bootup_requests"] == 1
