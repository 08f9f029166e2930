"""Telegrams that were sent back, and which error is the last one."""

from __future__ import annotations

import pytest

from tests.oracle.builders import telegram
from tests.oracle.reference import reference_report
from tests.oracle.wire import SECOND, A, B, Wire, icmp


@pytest.mark.parametrize(
    ("service", "error"),
    [(0, "UDPSENDATA"), (5, "UDPSENDACKN"), (6, "UDPSENDBOOTUPREQUEST"), (1, None), (77, None)],
)
def test_unreachable_quotes_a_telegram(service: int, error: str | None) -> None:
    report = reference_report([icmp(3, telegram(service, 4))])
    assert report["capture"]["other_frames"] == 1
    if error is None:
        assert report["lists"] == []
        return
    (entry,) = report["lists"]
    assert (entry["key"], entry["diag"]["sLastError"], entry["diag"]["tLastError"]) == ("udp/1202/4", error, "3")
    assert entry["counters"]["send_rejected"] == 1
    assert entry["nodes"][0]["address"] == A
    (finding,) = report["findings"]
    assert (finding["code"], finding["node"], finding["subindex"]) == ("NV305", A, 0)


def test_quote_must_reach_the_index() -> None:
    assert reference_report([icmp(0, telegram(), 9)])["lists"] == []
    report = reference_report([icmp(0, telegram(), 10)])
    assert report["lists"][0]["key"] == "udp/1202/1"
    assert report["findings"][0]["subindex"] is None
    assert reference_report([icmp(0, telegram(), 10, "fe80::1", "fe80::2")])["lists"][0]["key"] == "udp/1202/1"


def test_the_last_error_is_the_one_with_the_latest_time() -> None:
    # the wait ends at 1 s; the clock then steps back, and an earlier error comes later
    wire = Wire().data(0, 1, flags=1).nothing(SECOND + 1).ack(5, B, A, flags=4)
    assert (wire.only_list["diag"]["sLastError"], wire.only_list["diag"]["tLastError"]) == (
        "NOACKNOWLEDGEMENT",
        "1000000000",
    )
    assert wire.codes()["NV902"] == 1


def test_at_equal_times_a_deadline_comes_before_what_a_frame_says() -> None:
    wire = Wire().data(0, 1, flags=1).ack(SECOND, B, A, flags=4, subindex=1).nothing(SECOND + 1)
    assert wire.only_list["diag"]["nErrorCount"] == 2
    assert wire.only_list["diag"]["sLastError"] == "NOTACKNOWLEDGED"
    wire = Wire().data(0, 1, flags=3, checksum=1).data(5, 2, flags=3, checksum=2)
    assert (wire.only_list["diag"]["sLastError"], wire.only_list["diag"]["nErrorCount"]) == ("CHECKSUM", 2)
