"""Requests and replies brought together: each rule by a short conversation; all numbers were worked out by hand."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.rules.visu import Visu
from tests.oracle.tcp import ACK, RST, SYN
from tests.oracle.tcp_line import CLIENT, SERVER, Line, tcp_frame
from tests.oracle.visu_traffic import conversations

READ, READ_NAME = b"|0|1|0|4|144|1|0|", "visu/10.0.0.5/4,144,1,0"
WRITE = b"|1|1|0|4|144|1|0|1|"
PASSWORDS = b"|0|2|0|4|481|41|8|1|4|522|2|1|"
PAGE = b"""<v><variablelist><variable name=".CurrentPassword">4,481,41,8</variable>
<variable name="PLC_PRG.x">4,144,1,0</variable></variablelist></v>"""


def post(body: bytes, length: int | None = None) -> bytes:
    return (
        b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % (len(body) if length is None else length)
        + body
    )


def reply(body: bytes, status: int = 200, length: int | None = None) -> bytes:
    return b"HTTP/1.1 %d x\r\nContent-Length: %d\r\n\r\n" % (status, len(body) if length is None else length) + body


def get(target: bytes) -> bytes:
    return b"GET " + target + b" HTTP/1.1\r\n\r\n"


def seen(frames: Iterable[Frame]) -> Visu:
    visu = Visu()
    for frame in frames:
        visu.observe(frame)
    return visu


def figures(line: Line) -> dict[str, int]:
    """Return what is not 0 in the only row, but for what is the same in all."""
    (row,) = seen(line.frames).rows()
    return {name: value for name, value in row.items() if isinstance(value, int) and value and name != "port"}


def codes(line: Line) -> list[tuple[str, str, int, list[int]]]:
    return [
        (one["code"], one["variable"], one["count"], one["frames"]) for one in seen(line.frames).findings()
    ]  # fmt: skip


def test_a_row_has_everything() -> None:
    line = Line().open()
    for number in range(3):
        line.ask(post(READ)).wait(number * MILLISECOND).answer(reply(b"|1|")).wait(100 * MILLISECOND)
    visu = seen(line.frames)
    assert visu.rows() == [{
        "client": "10.0.0.1", "server": "10.0.0.5", "port": 80, "connections": 1, "reads": 3, "writes": 0, "entries": 3,
        "variables": 1, "replies": 3, "refused": 0, "unanswered": 0, "cut": 0, "gap_bytes": 0, "other_bytes": 0,
        "miscounted": 0,
        "ambiguous": 0,
        "latency_ns": {"count": 3, "p50": 2 * MILLISECOND, "p99": 3 * MILLISECOND, "max": 3 * MILLISECOND},
        "polling_ns": {"p50": 102 * MILLISECOND, "p99": 103 * MILLISECOND},
    }]  # fmt: skip
    (row,) = visu.rows()
    assert visu.latencies(row) == [1 * MILLISECOND, 2 * MILLISECOND, 3 * MILLISECOND]
    assert visu.pollings(row) == [102 * MILLISECOND, 103 * MILLISECOND]
    assert [(told.frame, told.kind, told.body) for told in visu.messages] == [
        (4, "request", READ), (5, "reply", b"|1|"), (6, "request", READ), (7, "reply", b"|1|"), (8, "request", READ),
        (9, "reply", b"|1|"),
    ]  # fmt: skip
    assert visu.findings() == []


def test_a_finding_has_everything() -> None:
    line = Line().open()
    for _ in range(12):
        line.ask(post(WRITE)).answer(reply(b"|0|"))
    assert seen(line.frames).findings() == [{
        "code": "NV801", "client": "10.0.0.1", "variable": READ_NAME, "count": 12, "first_ns": 3 * MILLISECOND,
        "last_ns": 25 * MILLISECOND, "frames": [4, 6, 8, 10, 12, 14, 16, 18, 20, 22],
    }]  # fmt: skip


def test_rows_are_sorted_by_address() -> None:
    frames = []
    for client, server in (
        ("fd00::1", "fd00::5"), ("10.0.0.10", "10.0.0.5"), ("10.0.0.9", "10.0.0.6"), ("10.0.0.9", "10.0.0.5")
    ):  # fmt: skip
        frames += Line((client, 50_000), (server, 80)).open().ask(post(READ)).frames
    rows = seen(frames).rows()
    assert [row["client"] for row in rows] == ["10.0.0.9", "10.0.0.9", "10.0.0.10", "fd00::1"]
    assert [row["server"] for row in rows] == ["10.0.0.5", "10.0.0.6", "10.0.0.5", "fd00::5"]


def test_who_says_nothing_of_webvisu_has_no_row() -> None:
    line = Line().open().ask(get(b"/index.htm")).answer(reply(b"")).ask(post(b"<soap>")).lose(True, 5).close(True)
    assert seen(line.frames).rows() == []


def test_each_connection_that_had_a_request_counts() -> None:
    frames = []
    for port, request in ((50_000, post(READ)), (50_001, post(READ)), (50_002, get(b"/"))):
        frames += Line(("10.0.0.1", port)).open().ask(request).frames
    (row,) = seen(frames).rows()
    assert row["connections"] == 2


def test_responses_answer_in_order() -> None:
    line = Line().open().ask(get(b"/a") + post(WRITE) + post(READ)).wait(SECOND)
    line.answer(reply(b"page") + reply(b"no")).wait(SECOND).answer(b"HTTP/1.1 100 x\r\n\r\n" + reply(b"|1|"))
    assert figures(line) == {
        "connections": 1, "reads": 1, "writes": 1, "entries": 2, "variables": 1, "replies": 2, "refused": 1,
    }  # fmt: skip
    assert codes(line) == [
        ("NV801", READ_NAME, 1, [4]), ("NV802", READ_NAME, 1, [5]), ("NV805", "visu/10.0.0.5", 2, [5, 6]),
    ]  # fmt: skip


def test_a_response_to_nobody_is_ignored() -> None:
    line = Line().open().answer(reply(b"|0|")).ask(post(READ)).answer(reply(b"|1|"))
    assert figures(line)["replies"] == 1


def test_a_response_to_head_has_no_body() -> None:
    line = Line().open().ask(b"HEAD /a HTTP/1.1\r\n\r\n" + post(READ)).answer(reply(b"", length=7) + reply(b"|1|"))
    assert figures(line)["replies"] == 1


def test_a_second_is_not_slow() -> None:
    for pause, found in ((999 * MILLISECOND, []), (999 * MILLISECOND + 1, [("NV805", "visu/10.0.0.5", 1, [5])])):
        assert codes(Line().open().ask(post(READ)).wait(pause).answer(reply(b"|1|"))) == found


def test_names_come_from_pages_and_count_from_then_on() -> None:
    line = Line().open().ask(post(WRITE)).answer(reply(b"|0|")).ask(get(b"/PLC_VISU.XML?1")).answer(reply(PAGE))
    other = Line(("10.0.0.2", 50_000), now=SECOND).open().ask(post(WRITE)).answer(reply(b"|1|"))
    found = seen([*line.frames, *other.frames]).findings()
    assert [(one["code"], one["client"], one["variable"]) for one in found] == [
        ("NV801", "10.0.0.1", READ_NAME), ("NV801", "10.0.0.2", "visu/10.0.0.5/PLC_PRG.x"),
        ("NV802", "10.0.0.2", "visu/10.0.0.5/PLC_PRG.x"),
    ]  # fmt: skip


@pytest.mark.parametrize("status", [404, 204])
def test_names_come_from_good_replies_only(status: int) -> None:
    line = Line().open().ask(get(b"/a.xml") + post(WRITE)).answer(reply(PAGE, status, None if status == 404 else 0))
    assert codes(line.ask(post(WRITE))) == [("NV801", READ_NAME, 2, [4, 6])]


def test_passwords_are_found_where_their_value_is_seen() -> None:
    named = Line().open().ask(get(b"/a.xml")).answer(reply(PAGE))
    password = "visu/10.0.0.5/.CurrentPassword"
    named.ask(post(PASSWORDS)).answer(reply(b"|geheim|1|"))
    assert codes(named) == [("NV803", password, 1, [7])]
    named.ask(post(PASSWORDS)).answer(reply(b"|???|1|")).ask(post(PASSWORDS)).answer(reply(b"|x|1|", 500))
    named.ask(post(b"|1|1|0|4|481|41|8|new|"))
    assert [one for one in codes(named) if one[0] == "NV803"] == [("NV803", password, 2, [7, 12])]
    assert codes(Line().open().ask(post(PASSWORDS)).answer(reply(b"|geheim|1|"))) == []


def test_what_is_miscounted_and_ambiguous() -> None:
    two = b"|0|2|0|4|0|9|8|1|4|9|9|8|"
    line = (
        Line().open().ask(post(b"|0|2|0|4|144|1|0|")).answer(reply(b"|1|2|")).ask(post(two)).answer(reply(b"|a|b|c|"))
    )
    assert figures(line) == {
        "connections": 1, "reads": 2, "entries": 3, "variables": 3, "replies": 2, "miscounted": 2, "ambiguous": 1,
    }  # fmt: skip
    assert codes(line) == [("NV804", "visu/10.0.0.5", 3, [4, 5, 7])]


def test_an_http_error_is_no_miscount() -> None:
    line = Line().open().ask(post(READ)).answer(reply(b"oops", 500))
    assert figures(line) == {"connections": 1, "reads": 1, "entries": 1, "variables": 1, "replies": 1}
    assert codes(line) == [("NV802", "visu/10.0.0.5", 1, [5])]


def test_queries() -> None:
    line = Line().open().ask(get(b"/READPI?ADR=MW1&ADR2=MW1")).answer(reply(b"1;2"))
    line.ask(get(b"/WRITEPI?ADR=MW2&VALUE=1")).answer(reply(b"", 403)).ask(get(b"/READPI?ADR=MW1&ADR2=MW1"))
    assert figures(line) == {
        "connections": 1, "reads": 2, "writes": 1, "entries": 5, "variables": 2, "replies": 2, "refused": 1,
    }  # fmt: skip
    variable = "visu/10.0.0.5/MW2"
    assert codes(line) == [("NV801", variable, 1, [6]), ("NV802", variable, 1, [7])]
    (row,) = seen(line.frames).rows()
    assert row["polling_ns"]["p50"] == 4 * MILLISECOND


def test_nobody_answers() -> None:
    line = Line().open().ask(post(READ) + get(b"/") + post(READ)).wait(SECOND).close(True)
    assert "unanswered" not in figures(line)
    line.close(False)
    assert figures(line)["unanswered"] == 2
    (found,) = seen(line.frames).findings()
    assert (found["code"], found["frames"]) == ("NV805", [4, 4])
    assert found["first_ns"] == found["last_ns"] == line.frames[-1].ts_ns


@pytest.mark.parametrize(("flags", "seq", "unanswered"), [(RST, 1, 1), (SYN, 77, 0)])
def test_nobody_answers_before_a_reset_and_nobody_knows_it_before_another_connection(
    flags: int, seq: int, unanswered: int
) -> None:
    line = Line().open().ask(post(READ))
    line.frames.append(tcp_frame(SECOND, CLIENT, SERVER, seq=seq, flags=flags))
    assert figures(line).get("unanswered", 0) == unanswered


def test_a_reply_up_to_the_end() -> None:
    for end in (Line.close, Line.reset):
        line = Line().open().ask(post(READ)).answer(b"HTTP/1.0 200 OK\r\n\r\n|1|").wait(5 * MILLISECOND)
        end(line, False)
        assert figures(line) == {"connections": 1, "reads": 1, "entries": 1, "variables": 1, "replies": 1}
        (row,) = seen(line.frames).rows()
        assert row["latency_ns"]["max"] == 7 * MILLISECOND


def test_a_request_up_to_the_end() -> None:
    request = b"POST / HTTP/1.0\r\n\r\n" + READ
    line = Line().open().ask(request).wait(5 * MILLISECOND).close(True).answer(reply(b"|1|"))
    (row,) = seen(line.frames).rows()
    assert (row["reads"], row["latency_ns"]["max"]) == (1, MILLISECOND)
    (row,) = seen(Line().open().ask(request).reset(True).frames).rows()
    assert (row["reads"], row["unanswered"]) == (1, 1)
    (row,) = seen(Line().open().ask(request[:-1]).reset(True).frames).rows()
    assert (row["reads"], row["unanswered"], row["connections"]) == (0, 0, 1)


def test_a_reply_that_is_not_whole_at_the_end_is_none_unless_bytes_are_missing() -> None:
    line = Line().open().ask(post(READ)).answer(reply(b"|1", length=3)).close(False)
    assert figures(line) == {"connections": 1, "reads": 1, "entries": 1, "variables": 1, "unanswered": 1}
    cut = Line().open().ask(post(READ)).say(False, reply(b"|1", length=4), captured=len(reply(b"|1")) - 1).close(False)
    assert (figures(cut)["cut"], figures(cut)["gap_bytes"]) == (1, 1)
    half_a_head = Line().open().ask(post(READ)).answer(b"HTTP/1.1 200 OK\r\nCont").close(False)
    assert figures(half_a_head)["unanswered"] == 1


def test_a_cut_request_counts_as_cut_and_its_reply_nowhere() -> None:
    line = Line().open().say(True, post(READ), captured=len(post(READ)) - 3).answer(reply(b"|1|"))
    assert figures(line) == {"connections": 1, "cut": 1, "gap_bytes": 3}
    assert figures(line.ask(post(READ)).answer(reply(b"|1|"))) == {
        "connections": 1, "cut": 1, "gap_bytes": 3, "reads": 1, "entries": 1, "variables": 1, "replies": 1,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("request_", "captured", "cut"),
    [(post(b"<soap>"), 54, False), (post(READ), 6, False), (post(READ), 3, False), (get(b"/READPI?ADR=MW1"), 20, False),
     (post(READ), len(post(READ)) - len(READ), True), (post(READ), post(READ).index(b"\n") + 1, True),
     (post(READ), post(READ).index(b"\n"), False), (post(b"<soap>"), len(post(b"<soap>")) - 6, True)],
)  # fmt: skip
def test_which_cut_requests_count(request_: bytes, captured: int, cut: bool) -> None:
    assert bool(seen(Line().open().say(True, request_, captured=captured).frames).rows()) is cut


def test_a_cut_reply_counts_as_cut() -> None:
    line = Line().open().ask(post(WRITE)).say(False, reply(b"|0|"), captured=len(reply(b"|0|")) - 1)
    line.ask(post(READ)).answer(reply(b"|1|"))
    assert figures(line) == {
        "connections": 1, "cut": 1, "gap_bytes": 1, "reads": 1, "writes": 1, "entries": 2, "variables": 1, "replies": 1,
    }  # fmt: skip


@pytest.mark.parametrize(("at_once", "replies"), [(1, {"replies": 1}), (2, {})])
def test_where_the_server_loses_step_those_that_wait_are_forgotten(at_once: int, replies: dict[str, int]) -> None:
    """Of who sends two at once, one reply may still be owed: nobody knows what answers the next request."""
    line = Line().open().ask(post(READ) * at_once).lose(False, 30).answer(b"|1|").segment(True)
    line.ask(post(READ)).answer(reply(b"|1|")).close(False)
    asked = at_once + 1
    assert figures(line) == {
        "connections": 1, "reads": asked, "entries": asked, "variables": 1, "cut": 1, "gap_bytes": 30, **replies,
    }  # fmt: skip


def test_where_the_client_loses_step_a_response_on_its_way_answers_nobody() -> None:
    line = Line().open().ask(post(READ)).answer(reply(b"", length=3)).lose(True, 40).ask(post(READ)).segment(False)
    line.answer(b"|1|").answer(reply(b"|2|"))
    visu = seen(line.frames)
    assert [told.body for told in visu.messages] == [READ, READ, b"|2|"]


def test_a_lost_request_and_its_reply() -> None:
    """The second request was not captured: the third one's acknowledgement says so, and its reply is to that one."""
    line = Line().open().ask(post(READ)).answer(reply(b"|1|")).lose(True, len(post(READ))).answer(reply(b"|2|"))
    line.ask(post(READ)).answer(reply(b"|3|"))
    assert figures(line) == {
        "connections": 1, "reads": 2, "entries": 2, "variables": 1, "replies": 2, "cut": 1,
        "gap_bytes": len(post(READ)),
    }  # fmt: skip


def test_a_reply_that_cannot_be_decoded_is_one_that_says_nothing() -> None:
    broken = b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 3\r\n\r\n|1|"
    assert figures(Line().open().ask(post(READ)).answer(broken))["replies"] == 1
    line = Line().open().ask(post(WRITE)).answer(broken)
    assert "refused" not in figures(line)
    assert seen(line.frames).writes[0].outcome == "open"
    assert figures(Line().open().ask(post(WRITE)).answer(broken.replace(b"200", b"500")))["refused"] == 1


def test_a_connection_that_began_before_the_capture() -> None:
    line = Line().segment(True, READ[5:] + post(READ)).lose(True, len(READ[5:] + post(READ)))
    line.segment(False, b"1|" + reply(b"|1|"), flags=ACK)
    assert figures(line) == {"connections": 1, "reads": 1, "entries": 1, "variables": 1, "replies": 1}


def test_a_direction_is_in_step_whenever_its_syn_came() -> None:
    """What is foreign breaks the pairing of one that is; one that began before the capture never was."""
    line = Line()
    line.segment(True, post(READ), SYN, seq=1000).lose(True, len(post(READ)))
    line.segment(False, flags=SYN | ACK, seq=5000).answer(b"foreign\r\n" + reply(b"|1|"))
    assert "replies" not in figures(line)
    line.frames.pop(1)
    assert figures(line)["replies"] == 1


def test_gaps_count_from_the_begin_of_a_connection_with_a_request() -> None:
    line = Line().open().lose(True, 9).ask(get(b"/")).lose(False, 7).answer(b"x").segment(True).segment(False)
    assert seen(line.frames).rows() == []
    assert figures(line.ask(post(READ)))["gap_bytes"] == 16


def test_frames_and_arrivals_of_what_came_out_of_order() -> None:
    """The end of the request came before its begin, and the clock went back between: the later frame tells when."""
    request = post(READ)
    line = Line(now=SECOND).open().segment(True, request[50:], seq=1051)
    line.now = 1
    line.segment(True, request[:50], seq=1001).lose(True, len(request))
    line.now = 2 * SECOND
    line.answer(reply(b"|1|"))
    visu = seen(line.frames)
    (row,) = visu.rows()
    assert visu.messages[0].frame == 5
    assert row["latency_ns"]["max"] == 2 * SECOND - line.frames[4].ts_ns


def no_more_than(row: dict[str, Any], parts: int) -> bool:
    """Whether the figures of a row fit together; ``parts`` are the requests that were never sent whole."""
    asked = row["reads"] + row["writes"] + parts
    return bool(
        row["replies"] + row["unanswered"] <= asked and row["refused"] <= row["writes"]
        and row["latency_ns"]["count"] <= row["replies"] and row["variables"] <= row["entries"]
        and row["miscounted"] <= asked + row["replies"] and 0 < row["connections"] <= asked + row["cut"]
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(0, 40, 3))
def test_figures_fit_together(seed: int) -> None:
    visu = seen(conversations(seed))
    assert all(no_more_than(row, visu.row_of(row).counts["part"]) for row in visu.rows())
