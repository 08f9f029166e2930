"""Acknowledgements and boot-up requests: what is in time, and what nobody answers."""

from __future__ import annotations

import pytest

from tests.oracle.wire import ALL, SECOND, A, B, C, Wire


def test_an_acknowledgement_at_the_deadline_is_in_time() -> None:
    wire = Wire().data(0, 1, flags=1).ack(SECOND, B, A)
    assert wire.counters("missing_acknowledgements") == (0,)
    assert wire.codes() == {}
    assert wire.only_list["readers"] == [B]


def test_an_acknowledgement_after_the_deadline_is_too_late() -> None:
    wire = Wire().data(5, 1, flags=1).ack(SECOND + 6, B, A)
    (missing,) = wire.findings("NV301")
    assert (missing["node"], missing["first_ns"], missing["last_ns"]) == (A, "1000000005", "1000000005")
    assert missing["frames"] == [1]
    assert wire.codes() == {"NV301": 1, "NV303": 1}
    assert wire.only_list["diag"]["sLastError"] == "NOACKNOWLEDGEMENT"
    assert wire.only_list["diag"]["tLastError"] == "1000000005"


@pytest.mark.parametrize(("later", "missing"), [(SECOND, 0), (SECOND + 1, 1)])
def test_any_frame_makes_a_deadline_pass(later: int, missing: int) -> None:
    wire = Wire().data(0, 1, flags=1).nothing(later)
    assert wire.counters("missing_acknowledgements") == (missing,)


def test_a_wait_that_is_open_at_the_end_is_no_event() -> None:
    assert Wire().data(0, 1, flags=1).only_list["diag"]["nErrorCount"] == 0


def test_the_next_data_telegram_finds_the_wait_open() -> None:
    wire = Wire().data(0, 1, flags=1).data(10, 2, flags=0).nothing(2 * SECOND)
    (missing,) = wire.findings("NV301")
    assert (missing["count"], missing["first_ns"]) == (1, "10")


def test_a_repeated_telegram_neither_finds_nor_opens_a_wait() -> None:
    wire = Wire().data(0, 1, flags=1).again(10).ack(20, B, A).nothing(3 * SECOND)
    assert wire.counters("missing_acknowledgements") == (0,)
    wire = Wire().data(0, 1, flags=1).ack(20, B, A).again(30, 0).nothing(3 * SECOND)
    assert wire.counters("missing_acknowledgements") == (0,)


def test_only_another_node_can_acknowledge_and_only_to_the_sender() -> None:
    assert Wire().data(0, 1, flags=1).ack(1, A, A).nothing(2 * SECOND).counters("missing_acknowledgements") == (1,)
    assert Wire().data(0, 1, flags=1).ack(1, B, C).nothing(2 * SECOND).counters("missing_acknowledgements") == (1,)
    assert Wire().data(0, 1, flags=1).ack(1, A, ALL).nothing(2 * SECOND).counters("missing_acknowledgements") == (1,)
    other = Wire().data(0, 1, flags=1).ack(1, B, A, subindex=1).nothing(2 * SECOND)
    assert other.counters("missing_acknowledgements") == (1,)


def test_a_broadcast_acknowledgement_closes_the_waits_of_all_senders() -> None:
    wire = Wire().data(0, 1, flags=1).data(0, 1, flags=1, source=B).ack(1, C, ALL).nothing(2 * SECOND)
    assert wire.counters("missing_acknowledgements") == (0,)
    wire = Wire().data(0, 1, flags=1).data(0, 1, flags=1, source=B).ack(1, C, A).nothing(2 * SECOND)
    (missing,) = wire.findings("NV301")
    assert missing["node"] == B


def test_negative_acknowledgement() -> None:
    wire = Wire().data(0, 1, flags=1).ack(7, B, A, flags=4).nothing(2 * SECOND)
    assert wire.counters("negative_acknowledgements", "missing_acknowledgements") == (1, 0)
    (finding,) = wire.findings("NV302")
    assert (finding["node"], finding["subindex"]) == (A, 0)
    node = wire.node(A)
    assert node is not None
    assert (node["nErrorCount"], node["sLastError"], node["tLastError"]) == (1, "NOTACKNOWLEDGED", "7")


def test_a_broadcast_negative_acknowledgement_blames_the_last_sender() -> None:
    wire = Wire().data(0, 1).data(1, 1, source=B).ack(2, C, ALL, flags=4)
    assert [finding["node"] for finding in wire.findings("NV302")] == [B]
    wire = Wire().ack(2, C, ALL, flags=4)
    assert [finding["node"] for finding in wire.findings("NV302")] == [None]
    assert wire.only_list["diag"]["nErrorCount"] == 1


@pytest.mark.parametrize(
    ("wire", "unexpected"),
    [
        (Wire().data(0, 1, flags=1).ack(SECOND, B, A), 0),
        (Wire().data(0, 1, flags=1).ack(SECOND + 1, B, A), 1),
        (Wire().data(0, 1, flags=0).ack(5, B, A), 1),
        (Wire().data(0, 1, flags=1).ack(5, B, A).ack(6, C, A), 0),
        (Wire().data(0, 1, flags=1).ack(5, B, C), 1),
        (Wire().data(0, 1, flags=1).ack(5, B, ALL), 0),
        (Wire().ack(5, B, A).data(6, 1, flags=1), 1),
    ],
)
def test_unexpected_acknowledgement(wire: Wire, unexpected: int) -> None:
    assert wire.codes().get("NV303", 0) == unexpected
    assert wire.only_list["diag"]["nErrorCount"] == (1 if wire.counters("missing_acknowledgements") == (1,) else 0)


def test_boot_up_request_answered_by_another_node() -> None:
    wire = Wire().boot_up(0, B).data(SECOND, 1, to=B).nothing(2 * SECOND)
    assert wire.counters("bootup_requests", "bootup_unanswered") == (1, 0)
    assert (wire.only_list["senders"], wire.only_list["readers"]) == ([A], [B])


def test_boot_up_request_that_nobody_answers() -> None:
    wire = Wire().boot_up(0, B, subindex=3).data(5, 1, subindex=2).data(6, 1, subindex=3, source=B).nothing(SECOND + 1)
    assert wire.counters("bootup_requests", "bootup_unanswered") == (1, 1)
    (finding,) = wire.findings("NV304")
    assert (finding["node"], finding["subindex"], finding["first_ns"], finding["frames"]) == (
        None,
        3,
        "1000000000",
        [1],
    )
    assert wire.only_list["diag"]["sLastError"] == "UDPANSWERBOOTUPREQUEST"
    node = wire.node(B)
    assert node is not None
    assert node["nErrorCount"] == 0


def test_one_answer_closes_all_requests() -> None:
    wire = Wire().boot_up(0, B).boot_up(1, B).boot_up(2, C).data(3, 1).nothing(2 * SECOND)
    assert wire.counters("bootup_requests", "bootup_unanswered") == (3, 0)
    wire = Wire().boot_up(0, B).boot_up(1, B).nothing(2 * SECOND)
    assert wire.counters("bootup_requests", "bootup_unanswered") == (2, 2)


def test_a_repeated_telegram_is_no_answer() -> None:
    wire = Wire().data(0, 1).boot_up(1, B).again(2, 0).nothing(2 * SECOND)
    assert wire.counters("bootup_unanswered") == (1,)
