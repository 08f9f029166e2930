"""The reference implementation against small examples whose numbers were worked out by hand."""

from __future__ import annotations

import copy
import struct
from collections import Counter
from fractions import Fraction
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import pytest

from tests.oracle import frame as frames_of
from tests.oracle.compare import differences
from tests.oracle.frame import Datagram, Frame, Unreachable, peel
from tests.oracle.reference import SEVERITIES, CounterSequence, Timing, erratic, reference_report, round_root
from tests.oracle.traffic import (
    LINKS,
    data_frame,
    generate,
    in_microseconds,
    internet_packet,
    link_frame,
    mutate,
    other_frame,
    telegram,
    udp,
    unreachable,
    whole,
    write_pcap,
)

SECOND = 1_000_000_000
A, B, C = "10.0.0.1", "10.0.0.2", "10.0.0.3"
ALL = "255.255.255.255"
ACK, BOOT_UP = 5, 6


class Wire:
    """Frames written down in order; times in nanoseconds."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def send(self, ts_ns: int, source: str, destination: str, payload: bytes, port: int = 1202) -> Wire:
        self.frames.append(data_frame(ts_ns, source, destination, payload, port=port))
        return self

    def data(
        self, ts_ns: int, counter: int, *, source: str = A, to: str = ALL, port: int = 1202, **fields: Any
    ) -> Wire:
        """Send a data telegram whose values differ from those of all others."""
        fields.setdefault("data", struct.pack("<I", len(self.frames)))
        return self.send(ts_ns, source, to, telegram(counter=counter, **fields), port)

    def ack(self, ts_ns: int, source: str, to: str, **fields: Any) -> Wire:
        return self.send(ts_ns, source, to, telegram(ACK, data=b"", **fields))

    def boot_up(self, ts_ns: int, source: str, to: str = ALL, **fields: Any) -> Wire:
        return self.send(ts_ns, source, to, telegram(BOOT_UP, data=b"", counter=0, **fields))

    def nothing(self, ts_ns: int) -> Wire:
        self.frames.append(other_frame(ts_ns))
        return self

    def again(self, ts_ns: int, number: int = -1) -> Wire:
        """Repeat an earlier frame byte for byte."""
        self.frames.append(self.frames[number]._replace(ts_ns=ts_ns))
        return self

    @property
    def report(self) -> dict[str, Any]:
        return reference_report(self.frames)

    @property
    def only_list(self) -> dict[str, Any]:
        """The report of the only list."""
        (entry,) = self.report["lists"]
        return dict(entry)

    @property
    def stream(self) -> dict[str, Any]:
        (stream,) = self.only_list["streams"]
        return dict(stream)

    def figures(self) -> tuple[int | None, int, int, int]:
        """Lost, duplicates, overtaken, restarts of the only stream."""
        stream = self.stream
        return stream["lost"], stream["duplicates"], stream["overtaken"], stream["restarts"]

    def counters(self, *names: str) -> tuple[int, ...]:
        return tuple(self.only_list["counters"][name] for name in names)

    def findings(self, code: str) -> list[dict[str, Any]]:
        return [finding for finding in self.report["findings"] if finding["code"] == code]

    def codes(self) -> dict[str, int]:
        return {finding["code"]: finding["count"] for finding in self.report["findings"]}

    def node(self, address: str) -> dict[str, Any] | None:
        """The components of a node on the only list."""
        diags = {node["address"]: node["diag"] for node in self.only_list["nodes"]}
        return diags.get(address)


def counted(*counters: int) -> Wire:
    """Return one stream with these counters, 100 ms apart."""
    wire = Wire()
    for number, counter in enumerate(counters):
        wire.data(number * 100_000_000, counter)
    return wire


# --- section 4, the table of steps ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("h", "missing", "c", "regular_zero", "repeated", "kind", "lost", "h_after", "missing_after"),
    [
        # d = 1, also through zero
        (5, set(), 6, False, False, "regular", 0, 6, set()),
        (65535, set(), 0, False, False, "regular", 0, 0, set()),
        (0, set(), 1, False, False, "regular", 0, 1, set()),
        # d = 0 where regular, repeated or not
        (5, set(), 5, True, False, "regular", 0, 5, set()),
        (5, set(), 5, True, True, "regular", 0, 5, set()),
        # senders that wrap early
        (255, set(), 0, False, False, "regular", 0, 0, set()),
        (65534, set(), 0, False, False, "regular", 0, 0, set()),
        # a counter that was missing stays so over an early wrap at 65534 (65530 is 6 behind), not over one at 255
        (65534, {65530}, 0, False, False, "regular", 0, 0, {65530}),
        (255, {250}, 0, False, False, "regular", 0, 0, set()),
        # d = 0
        (5, set(), 5, False, True, "duplicate", 0, 5, set()),
        (5, set(), 5, False, False, "nothing", 0, 5, set()),
        # missing before anything that follows
        (9, {7, 8}, 7, False, False, "overtaken", -1, 9, {8}),
        (3, {0, 1}, 1, False, False, "overtaken", -1, 3, {0}),
        # 0 and 1 where they are not missing
        (9, {7}, 0, False, False, "restart", 0, 0, set()),
        (9, {7}, 1, False, False, "restart", 0, 1, set()),
        (65533, set(), 1, False, False, "restart", 0, 1, set()),
        # ... and next to the end of the range
        (65534, set(), 1, False, False, "gap", 2, 1, {65535, 0}),
        (65535, set(), 1, False, False, "gap", 1, 1, {0}),
        # forward
        (5, set(), 7, False, False, "gap", 1, 7, {6}),
        (5, {3}, 9, False, False, "gap", 3, 9, {3, 6, 7, 8}),
        (5, set(), 5 + 32767, False, False, "gap", 32766, 32772, set(range(32772 - 64, 32772))),
        # a missing counter leaves the window when it is 65 behind
        (70, {6}, 71, False, False, "regular", 0, 71, set()),
        (69, {6}, 70, False, False, "regular", 0, 70, {6}),
        # backward
        (100, set(), 99, False, False, "duplicate", 0, 100, set()),
        (100, set(), 36, False, False, "duplicate", 0, 100, set()),
        (100, {99}, 35, False, False, "restart", 0, 35, set()),
        (5, {4}, 5 + 32768, False, False, "restart", 0, 32773, set()),
        # 65535 after 0 is one behind
        (0, set(), 65535, False, False, "duplicate", 0, 0, set()),
    ],
)
def test_step(
    h: int,
    missing: set[int],
    c: int,
    regular_zero: bool,
    repeated: bool,
    kind: str,
    lost: int,
    h_after: int,
    missing_after: set[int],
) -> None:
    sequence = CounterSequence(h=h, missing=set(missing))
    assert sequence.step(c, zero_is_regular=regular_zero, repeated=repeated) == (kind, lost)
    assert (sequence.h, sequence.missing) == (h_after, missing_after)
    assert (sequence.steps, sequence.regular) == (1, int(kind == "regular"))


def test_first_telegram_only_sets_h() -> None:
    sequence = CounterSequence()
    assert sequence.step(7, zero_is_regular=True, repeated=False) == ("first", 0)
    assert (sequence.h, sequence.steps) == (7, 0)


@pytest.mark.parametrize(
    ("counters", "figures"),
    [
        # lost, duplicates, overtaken, restarts
        ((1, 2, 3, 4), (0, 0, 0, 0)),
        ((1, 2, 5, 6), (2, 0, 0, 0)),
        ((1, 2, 4, 3, 5), (0, 0, 1, 0)),
        ((1, 2, 4, 3, 3, 5), (0, 1, 1, 0)),
        ((50, 51, 52, 1, 2), (0, 0, 0, 1)),
        ((50, 51, 49, 52), (0, 1, 0, 0)),
        ((10, 80, 16, 15), (68, 0, 1, 1)),
        ((65533, 65534, 0, 1), (0, 0, 0, 0)),
        ((254, 255, 0, 1), (0, 0, 0, 0)),
        # the first value again and again takes no step; then 9 comes two after 7
        ((7, 7, 7, 9), (1, 0, 0, 0)),
        # a stream that never shows a second value has no figures
        ((7, 7, 7, 7), (0, 0, 0, 0)),
    ],
)
def test_figures_of_a_stream(counters: tuple[int, ...], figures: tuple[int, int, int, int]) -> None:
    assert counted(*counters).figures() == figures


def test_gaps_stay_when_an_overtaken_telegram_takes_its_loss_back() -> None:
    wire = counted(1, 2, 6, 4, 7)
    assert wire.counters("lost", "gaps", "longest_gap", "overtaken") == (2, 1, 3, 1)
    (gap,) = wire.findings("NV201")
    assert (gap["count"], gap["frames"], gap["first_ns"]) == (1, [3], "200000000")
    (overtaken,) = wire.findings("NV203")
    assert (overtaken["list"], overtaken["node"], overtaken["subindex"]) == ("udp/1202/1", A, 0)
    assert overtaken["frames"] == [4]


def test_repeated_frames_are_duplicates_from_the_second_value_on() -> None:
    wire = Wire().data(0, 1).again(1).again(2).data(3, 2).again(4).data(5, 3).again(6).again(7)
    assert wire.figures() == (0, 3, 0, 0)
    assert wire.stream["telegrams"] == 8
    # 0, 1, 2 (no steps yet), 3, 5: the repeated ones after them do not count
    assert (wire.stream["interval_ns"]["count"], wire.stream["interval_ns"]["max"]) == (4, 2)


def test_same_counter_with_other_values_is_nothing() -> None:
    wire = counted(1, 2, 2, 3)
    assert wire.figures() == (0, 0, 0, 0)
    assert wire.stream["interval_ns"]["count"] == 3


# --- section 4, scopes ----------------------------------------------------------------------------------------------


def scopes(wire: Wire) -> list[str]:
    return [stream["counter_scope"] for entry in wire.report["lists"] for stream in entry["streams"]]


def test_one_counter_per_stream() -> None:
    wire = Wire()
    for cycle in range(4):
        for subindex in (0, 1):
            wire.data(cycle, cycle + 1, subindex=subindex)
    # stream: 6 of 6; node-telegram: 1 1 2 2 3 3 4 4 has 3 of 7; one list only, so node-send is not considered
    assert scopes(wire) == ["stream", "stream"]
    assert wire.codes() == {}


def test_one_counter_per_telegram() -> None:
    wire = Wire()
    for number in range(8):
        wire.data(number, number + 1, subindex=number % 2)
    assert scopes(wire) == ["node-telegram"] * 2
    assert wire.counters("lost", "gaps") == (0, 0)
    (finding,) = wire.findings("NV206")
    assert (finding["list"], finding["node"], finding["subindex"], finding["count"]) == (None, A, None, 1)


def test_one_counter_per_send() -> None:
    wire = Wire()
    counter = 0
    for _ in range(3):
        for list_id in (1, 2):
            counter += 1
            wire.data(counter, counter, list_id=list_id, subindex=0)
            wire.data(counter, counter, list_id=list_id, subindex=1)
    # stream: 0 of 8 (+2 each); node-telegram: 5 of 11; node-send: 11 of 11
    assert scopes(wire) == ["node-send"] * 4
    assert {entry["counters"]["lost"] for entry in wire.report["lists"]} == {0}


def test_a_lost_counter_is_booked_where_the_step_is_taken() -> None:
    wire = Wire()
    for number, counter in enumerate((1, 2, 3, 4, 5, 6, 8, 9, 7, 10, 11, 12)):
        wire.data(number, counter, subindex=number % 2)
    # node-telegram: 8 of 11 regular; 8 (SubIndex 0) finds 7 lost, and 7 (SubIndex 0 again) takes it back
    assert scopes(wire) == ["node-telegram"] * 2
    first, second = wire.only_list["streams"]
    assert (first["lost"], first["overtaken"]) == (0, 1)
    assert (second["lost"], second["overtaken"]) == (0, 0)


def test_lost_of_one_stream_can_be_negative() -> None:
    wire = Wire()
    order = ((1, 0), (2, 1), (3, 0), (4, 1), (6, 0), (5, 1), (7, 0), (8, 1), (9, 0), (10, 1))
    for number, (counter, subindex) in enumerate(order):
        wire.data(number, counter, subindex=subindex)
    # steps: + + + gap overtaken + + + +: 7 of 9. The streams: 1 3 6 7 9 and 2 4 5 8 10 have 1 of 8 regular
    assert scopes(wire) == ["node-telegram"] * 2
    assert [stream["lost"] for stream in wire.only_list["streams"]] == [1, -1]
    assert wire.counters("lost", "gaps", "longest_gap", "overtaken") == (0, 1, 1, 1)


def test_equal_shares_go_to_the_stream() -> None:
    wire = Wire().data(0, 1, subindex=0).data(1, 9, subindex=1)
    # one step of node-telegram, a gap: share 0; no steps in the streams: share 0
    assert scopes(wire) == ["stream", "stream"]


def test_constant_counter_is_unused_from_eight_telegrams_on() -> None:
    assert counted(*[1] * 7).stream["counter_scope"] == "stream"
    wire = counted(*[1] * 8)
    assert wire.stream["counter_scope"] == "unused"
    assert wire.codes() == {"NV205": 1}
    assert counted(*[1] * 8, 2).stream["counter_scope"] == "stream"


def test_a_sender_that_does_not_count_is_erratic() -> None:
    # steps of 256: 255 lost each, 9 telegrams in 8 intervals of 100 ms
    wire = counted(*(number * 256 for number in range(1, 10)))
    assert wire.figures() == (None, 0, 0, 0)
    assert (wire.stream["lost_claimed"], wire.counters("lost", "lost_claimed")) == (8 * 255, (None, 8 * 255))
    assert wire.codes() == {"NV207": 8}


def test_loss_in_a_pause_is_loss() -> None:
    assert not erratic(lost=300, telegrams=40, duration=60 * SECOND, median=SECOND)  # limit 100 + 10 × 20
    assert erratic(lost=301, telegrams=40, duration=60 * SECOND, median=SECOND)
    assert not erratic(lost=100, telegrams=9, duration=0, median=None)
    assert erratic(lost=101, telegrams=9, duration=0, median=None)
    assert not erratic(lost=400, telegrams=400, duration=0, median=SECOND)


# --- section 3, acknowledgements ------------------------------------------------------------------------------------


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


# --- section 3, boot-up requests and the other errors ---------------------------------------------------------------


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


def test_checksum_is_measured_against_the_first_one_seen() -> None:
    wire = (
        Wire()
        .data(0, 1, checksum=9)  # bit1 clear: no reference, but NV404
        .data(1, 2, flags=2, checksum=7)
        .data(2, 1, flags=2, checksum=8, source=B)
        .data(3, 2, flags=2, checksum=7, source=B)
        .data(4, 1, flags=2, checksum=8, subindex=1)
    )
    assert wire.counters("checksum_mismatches") == (1,)
    assert wire.only_list["diag"]["nWriteCount"] == 4
    (changed,) = wire.findings("NV403")
    assert (changed["node"], changed["frames"]) == (B, [3])
    assert [finding["frames"] for finding in wire.findings("NV404")] == [[1]]
    assert [finding["frames"] for finding in wire.findings("NV401")] == [[3]]


def icmp(ts_ns: int, payload: bytes, quote_bytes: int = 1000, source: str = A, router: str = C) -> Frame:
    head, to = (28, B) if ip_address(source).version == 4 else (48, "ff02::1")
    packet = internet_packet(ip_address(source), ip_address(to), 17, udp(payload))
    return whole(ts_ns, 1, link_frame(unreachable(ip_address(router), packet[: head + quote_bytes])))


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


# --- section 2, who gets what ---------------------------------------------------------------------------------------


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


# --- section 3, malformed and truncated -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("payload", "codes"),
    [
        (telegram()[:12], {"NV101": 1}),
        (telegram()[:19], {"NV101": 1}),
        (telegram(length=23), {"NV102": 1}),
        (telegram(length=22 << 8), {"NV105": 1}),
        (telegram(7), {"NV103": 1}),
        (telegram(7, length=23), {"NV102": 1}),
        (telegram(7)[:15], {"NV101": 1}),
        (telegram(flags=8), {"NV104": 1}),
        (telegram(flags=8, length=23), {"NV102": 1}),
        (telegram(identity=b"0-S3"), {"NV106": 1}),
    ],
)
def test_malformed(payload: bytes, codes: dict[str, int]) -> None:
    wire = Wire().send(0, A, ALL, payload)
    assert wire.codes() == codes
    malformed = int(not codes.keys() & {"NV104", "NV106"})
    assert wire.counters("malformed", "truncated") == (malformed, 0)
    entry = wire.only_list
    is_data = payload[4] == 0
    assert (entry["diag"]["nSendCount"], entry["diag"]["nReceiveCount"]) == (int(is_data), 1)
    assert (len(entry["streams"]), entry["diag"]["nWriteCount"]) == (1 - malformed, 1 - malformed)
    assert entry["senders"] == ([A] if is_data else [])


def cut(frame: Frame, payload_bytes: int) -> Frame:
    return frame._replace(data=frame.data[: 42 + payload_bytes])


@pytest.mark.parametrize(
    ("payload", "captured", "codes", "malformed", "received"),
    [
        (telegram(), 21, {"NV107": 1}, 0, 1),
        (telegram(), 20, {"NV107": 1}, 0, 1),
        (telegram(), 19, {"NV107": 1}, 0, 0),
        (telegram(), 12, {"NV107": 1}, 0, 0),
        (telegram(length=3), 20, {"NV102": 1, "NV107": 1}, 1, 1),
        (telegram(7), 20, {"NV103": 1, "NV107": 1}, 1, 1),
        (telegram()[:19], 18, {"NV107": 1}, 0, 0),
    ],
)
def test_truncated(payload: bytes, captured: int, codes: dict[str, int], malformed: int, received: int) -> None:
    wire = Wire().send(0, A, ALL, payload)
    wire.frames[0] = cut(wire.frames[0], captured)
    assert wire.codes() == codes
    assert wire.counters("malformed", "truncated") == (malformed, 1)
    assert wire.only_list["diag"]["nReceiveCount"] == received
    assert wire.report["capture"]["telegrams"] == 1


def test_eleven_captured_bytes_are_no_telegram() -> None:
    report = reference_report([cut(data_frame(0, A, B, telegram()), 11)])
    assert report["capture"] | {"start_ns": None, "end_ns": None} == {
        "frames": 1,
        "telegrams": 0,
        "other_frames": 1,
        "drops": 0,
        "start_ns": None,
        "end_ns": None,
    }
    assert report["lists"] == []


# --- sections 5 and 6 -----------------------------------------------------------------------------------------------


def test_intervals() -> None:
    wire = Wire().data(0, 1).data(10, 2).data(30, 3).data(31, 4)
    timing = wire.stream["interval_ns"]
    # 10, 20, 1: mean 31/3 = 10.33, variance 501/3 − 961/9 = 542/9 = 60.2, root 7.76
    assert (timing["count"], timing["min"], timing["mean"], timing["max"], timing["stddev"]) == (3, 1, 10, 20, 8)
    assert (timing["p50"], timing["p95"], timing["p99"], timing["nominal"]) == (10, 20, 20, None)


def test_intervals_are_negative_where_the_clock_steps_back() -> None:
    wire = Wire().data(100, 1).data(40, 2)
    assert (wire.stream["interval_ns"]["min"], wire.stream["interval_ns"]["mean"]) == (-60, -60)
    (step,) = wire.findings("NV902")
    assert (step["list"], step["node"], step["count"], step["frames"]) == (None, None, 1, [2])


def test_a_single_telegram_has_no_intervals() -> None:
    assert set(counted(1).stream["interval_ns"].values()) == {0, None}


def test_pace() -> None:
    """Two streams in 900 ns; of 8 intervals of 100 ns one is 130: jitter is 30 %. Two of three are answered."""
    wire = Wire()
    waits = dict.fromkeys(range(3), 1)
    for number, time in enumerate([0, 100, 200, 300, 400, 530, 630, 730, 830]):
        wire.data(time, number, flags=waits.get(number, 0))
        if number in (0, 2):
            wire.ack(time + 10 * number + 10, B, A, counter=number)
    entry = wire.data(900, 7, subindex=1).only_list
    took = {"count": 2, "p50": 10, "p99": 30, "max": 30}
    for row, telegrams in ((entry["streams"][0], 9), (entry, 10), (entry["nodes"][0], 10)):
        assert (row["rate"], row["jitter"], row["latency_ns"]) == (pytest.approx(telegrams / 900e-9), 30.0, took)
    for row, rate in ((entry["streams"][1], pytest.approx(1 / 900e-9)), (entry["nodes"][1], 0.0)):
        nothing = {"count": 0, "p50": None, "p99": None, "max": None}
        assert (row["rate"], row["jitter"], row["latency_ns"]) == (rate, None, nothing)
    assert counted(1).stream["rate"] is None


def test_rounding_is_half_to_even() -> None:
    assert Timing((1, 2)).report()["mean"] == 2  # 1.5
    assert Timing((2, 3)).report()["mean"] == 2  # 2.5
    assert Timing((1, 2)).report()["stddev"] == 0  # 0.5
    assert Timing((0, 3)).report()["stddev"] == 2  # 1.5
    assert round_root(Fraction(25, 4)) == 2  # 2.5
    assert round_root(Fraction(63, 10)) == 3  # 2.51


def test_percentiles_are_of_the_nearest_rank() -> None:
    timing = Timing(tuple(range(1, 101)))
    assert [timing.percentile(percent) for percent in (5, 50, 95, 99)] == [5, 50, 95, 99]
    assert [Timing((1, 2, 3)).percentile(percent) for percent in (5, 50, 95, 99)] == [1, 2, 3, 3]


def test_nominal_is_the_median_of_a_cyclic_stream() -> None:
    assert Timing((100, 100, 150)).nominal == 100  # 50 wide: 50 % of 100
    assert Timing((100, 100, 151)).nominal is None


def test_a_stream_stops_while_the_capture_goes_on() -> None:
    wire = counted(1, 2, 3)  # every 100 ms until 200 ms
    assert wire.nothing(1_200_000_000).codes() == {}
    assert wire.nothing(1_200_000_001).codes() == {"NV504": 1}


def test_shape_changes_whoever_sends() -> None:
    wire = Wire().data(0, 1).data(1, 1, source=B, items=2).data(2, 2, items=2).data(3, 3, items=2, data=b"")
    wire.send(4, A, ALL, telegram(length=77)).data(5, 4, items=2, data=b"")
    assert [(finding["node"], finding["frames"]) for finding in wire.findings("NV402")] == [(A, [4]), (B, [2])]
    assert (wire.only_list["streams"][0]["items"], wire.only_list["streams"][0]["length"]) == (2, 20)


def test_flags_that_change_with_the_wrap() -> None:
    wire = Wire().data(0, 65534).data(1, 65535).data(2, 0, flags=1).data(3, 1, flags=1)
    (finding,) = wire.findings("NV404")
    assert (finding["count"], finding["frames"]) == (1, [3])


def test_stream_shows_the_last_checksum() -> None:
    assert Wire().data(0, 1, flags=2, checksum=5).stream["checksum"] == 5
    assert Wire().data(0, 1, flags=2, checksum=5).data(1, 2).stream["checksum"] is None


def test_findings_are_sorted_by_severity_first() -> None:
    wire = Wire().send(0, A, ALL, telegram(flags=8)).send(1, A, ALL, telegram(7)).send(2, A, ALL, telegram(length=1))
    assert [finding["code"] for finding in wire.report["findings"]] == ["NV102", "NV103", "NV104"]
    assert [finding["severity"] for finding in wire.report["findings"]] == ["error", "warning", "note"]


# --- frames ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("link", LINKS)
def test_every_link_type_is_peeled(link: int) -> None:
    source, to = ("::1", "2001:db8::2") if link == frames_of.IPV6 else (A, B)
    found = peel(data_frame(0, source, to, telegram(), link=link))
    assert found == Datagram(ip_address(source), ip_address(to), 1202, 22, telegram(), broadcast=False)


def packet(source: str = A, to: str = B, **how: Any) -> bytes:
    return internet_packet(ip_address(source), ip_address(to), 17, udp(telegram()), **how)


@pytest.mark.parametrize(
    ("data", "is_telegram"),
    [
        (link_frame(packet(), tags=(0x8100,)), True),
        (link_frame(packet(), tags=(0x88A8, 0x8100)), True),
        (link_frame(packet(), tags=(0x9100,)), True),
        (link_frame(packet(options=bytes(40))), True),
        (link_frame(packet("::1", "::2", extensions=(0, 43, 60, 51))), True),
        (link_frame(packet("::1", "::2", fragment=(0, False))), True),
        (link_frame(packet("::1", "::2", fragment=(0, True))), False),
        (link_frame(packet("::1", "::2", fragment=(1, False))), False),
        (link_frame(packet(fragment=(0, True))), False),
        (link_frame(packet(fragment=(1, False))), False),
        (link_frame(packet(total_length=0)), True),
        (link_frame(packet(total_length=39)), False),
        (link_frame(packet(total_length=40)), True),
        (link_frame(packet(), ethertype=0x86DD), False),
        (link_frame(packet(), ethertype=0x88CC), False),
    ],
)
def test_what_a_frame_may_wear(data: bytes, is_telegram: bool) -> None:
    assert reference_report([whole(0, 1, data)])["capture"]["telegrams"] == int(is_telegram)


@pytest.mark.parametrize(
    ("link", "to", "how", "broadcast"),
    [
        (1, B, {"broadcast": True}, True),
        (1, "10.0.0.255", {}, False),
        (1, ALL, {}, True),
        (1, "225.10.10.11", {}, True),
        (1, "ff02::1", {}, True),
        (113, B, {"packet_type": 1}, True),
        (113, B, {"packet_type": 2}, True),
        (113, "10.0.0.255", {"packet_type": 4}, False),
        (276, B, {"packet_type": 2}, True),
        (276, B, {"packet_type": 3}, False),
        (101, "10.0.0.255", {}, True),
        (101, B, {}, False),
        (0, "10.0.0.255", {}, True),
        (101, "::ff", {}, False),
    ],
)
def test_broadcast(link: int, to: str, how: dict[str, Any], broadcast: bool) -> None:
    found = peel(whole(0, link, link_frame(packet("::1" if ":" in to else A, to), link, **how)))
    assert isinstance(found, Datagram)
    assert found.broadcast is broadcast


def test_padding_belongs_to_no_datagram() -> None:
    short = telegram(data=b"")[:14]
    data = link_frame(internet_packet(ip_address(A), ip_address(B), 17, udp(short))) + b"\xff" * 4
    found = peel(whole(0, 1, data))
    assert isinstance(found, Datagram)
    assert found.payload == short
    quoted = peel(whole(0, 1, icmp(0, telegram(), 9).data + b"\1\0\0\0"))
    assert isinstance(quoted, Unreachable)
    assert len(quoted.quoted.payload) == 9


def test_a_real_boot_up_request() -> None:
    report = Wire().send(0, A, ALL, bytes.fromhex("002d5333060000000a0002000100140000000000")).report
    assert (report["lists"][0]["key"], report["lists"][0]["readers"]) == ("udp/1202/10", [A])
    assert report["lists"][0]["counters"]["bootup_requests"] == 1


# --- traffic and comparison -----------------------------------------------------------------------------------------


def test_a_seed_gives_the_same_frames() -> None:
    assert generate(5, 100) == generate(5, 100)
    assert generate(5, 100) != generate(6, 100)
    assert mutate(1, generate(5, 100)) == mutate(1, generate(5, 100))


def test_traffic_shows_every_fault() -> None:
    codes: Counter[str] = Counter()
    counters: Counter[str] = Counter()
    seen_scopes: set[str] = set()
    clean = 0
    for seed in range(48):
        frames = generate(seed, 300, (None, *LINKS, 1, 1, 1)[seed % 12])
        if seed % 4 == 3:
            frames = mutate(seed, frames)
        report = reference_report(frames)
        assert report["capture"]["frames"] == len(frames)
        codes.update(finding["code"] for finding in report["findings"])
        clean += not any(finding["severity"] == "error" for finding in report["findings"])
        for entry in report["lists"]:
            counters.update(name for name, value in entry["counters"].items() if value and name[0] != "_")
            seen_scopes |= {stream["counter_scope"] for stream in entry["streams"]}
    assert set(codes) == set(SEVERITIES)
    assert len(counters) == 15
    assert seen_scopes == {"stream", "node-telegram", "node-send", "unused"}
    assert clean


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("nanoseconds", [False, True])
def test_pcap_holds_the_frames(tmp_path: Path, nanoseconds: bool, big_endian: bool) -> None:
    frames = generate(3, 50)
    write_pcap(frames, tmp_path / "x.pcap", nanoseconds=nanoseconds, big_endian=big_endian)
    data = (tmp_path / "x.pcap").read_bytes()
    order = ">" if big_endian else "<"
    assert struct.unpack_from(order + "I", data)[0] == (0xA1B23C4D if nanoseconds else 0xA1B2C3D4)
    at, back = 24, []
    while at < len(data):
        seconds, rest, captured, original = struct.unpack_from(order + "IIII", data, at)
        time = seconds * SECOND + rest * (1 if nanoseconds else 1000)
        back.append(Frame(time, 1, data[at + 16 : at + 16 + captured], original))
        at += 16 + captured
    assert back == (frames if nanoseconds else in_microseconds(frames))


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
