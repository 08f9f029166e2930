"""Captures of one direction only: what acknowledgements tell of the other one."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.laws import examples, some
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, SYN, peel_tcp
from tests.oracle.tcp_line import CLIENT, SERVER, Line, tcp_frame
from tests.oracle.visu_traffic import conversations
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_names import told as report_of

WRITE = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 19\r\n\r\n|1|1|0|4|0|4|6|9.5|"
DONE = b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|0|"
PAGE = b"HTTP/1.1 200 OK\r\nContent-Length: 6\r\n\r\n<html>"


def of_one(frames: list[Frame], *, client: bool) -> list[Frame]:
    """Return the frames that clients, or servers, sent."""
    found = []
    for frame in frames:
        segment = peel_tcp(frame)
        assert segment is not None
        if (segment.source_port >= 50_000) == client:
            found.append(frame)
    return found


def check(frames: list[Frame], packets: int) -> None:
    rules = by_the_rules(frames)
    state = followed(cut(batch_of(frames), packets))
    rows, findings = told(state)
    assert findings == rules.findings()
    assert writes_of(state) == writes_by_the_rules(rules)
    names = ("connections", "reads", "writes", "replies", "unanswered", "cut", "gap_bytes")
    assert [[row[name] for name in names] for row in rows] == [[row[name] for name in names] for row in rules.rows()]


def figures(frames: list[Frame]) -> dict[str, int]:
    """Return what is counted of the only row, the same however the frames are cut; nothing without a row."""
    for packets in (1, 2, len(frames)):
        check(frames, packets)
    rows, _ = told(followed([batch_of(frames)]))
    names = ("writes", "replies", "unanswered", "cut", "gap_bytes")
    return {name: row[name] for row in rows for name in names if row[name]}


def kept(exchanges: int = 5) -> Line:
    line = Line()
    for _ in range(exchanges):
        line.wait(SECOND).ask(WRITE).answer(DONE)
    return line


def test_what_clients_acknowledge_is_missing() -> None:
    assert figures(of_one(kept().frames, client=True)) == {"writes": 5, "cut": 4, "gap_bytes": 4 * len(DONE)}
    alone = Line().open().ask(WRITE).answer(DONE).segment(True).close(False).segment(True).close(True)
    assert figures(of_one(alone.frames, client=True)) == {"writes": 1, "cut": 1, "gap_bytes": len(DONE)}
    ended = Line().open().ask(WRITE).answer(DONE).close(False).close(True)
    assert figures(of_one(ended.frames, client=True))["cut"] == 1


def test_what_servers_acknowledge_is_missing() -> None:
    assert figures(of_one(kept().frames, client=False)) == {"cut": 4, "gap_bytes": 4 * len(WRITE)}
    alone = Line().open().ask(WRITE).segment(False).answer(DONE).close(False)
    assert figures(of_one(alone.frames, client=False)) == {"cut": 1, "gap_bytes": len(WRITE)}


def test_of_other_sites_nobody_knows_anything() -> None:
    line = Line().open()
    for _ in range(5):
        line.ask(WRITE).answer(PAGE)
    assert figures(of_one(line.frames, client=False)) == {}


def test_who_gets_no_reply_lacks_none() -> None:
    line = Line().open().ask(WRITE).segment(False).wait(SECOND).segment(True, b"\0", seq=1000 + len(WRITE))
    line.segment(False).close(True).segment(False)
    assert "cut" not in figures(line.frames)
    assert "cut" not in figures(of_one(line.frames, client=True))
    for end in (line.close(False).segment(True), line.reset(True)):
        assert "cut" not in figures(of_one(end.frames, client=True))


def test_what_begins_nothing_lacks_nothing() -> None:
    assert figures([tcp_frame(0, CLIENT, SERVER, flags=SYN), tcp_frame(SECOND, CLIENT, SERVER, flags=SYN)]) == {}
    probes = [tcp_frame(number * SECOND, CLIENT, SERVER, seq=9, ack=50 * number, flags=ACK) for number in range(4)]
    assert figures(probes) == {}


def test_a_connection_that_began_before_the_capture_lacks_nothing() -> None:
    line = Line()
    line.lose(False, 100).segment(True).ask(WRITE).answer(DONE).segment(True).ask(WRITE).answer(DONE)
    assert figures(line.frames) == {"writes": 2, "replies": 2}
    behind_request = Line().lose(True, 100).answer(DONE).ask(WRITE).answer(DONE)
    assert figures(behind_request.frames) == {"writes": 1, "replies": 1}


@pytest.mark.parametrize("client", [True, False])
def test_it_is_a_finding_and_a_cause(client: bool, tmp_path: Path) -> None:
    report = report_of(of_one(kept().frames, client=client), tmp_path)
    assert "NV808" in [one["code"] for one in report["findings"]]
    assert [one["kind"] for one in report["causes"]] == ["capture-incomplete"]


@pytest.mark.parametrize("seed", some(range(40)))
@pytest.mark.parametrize("client", [True, False])
def test_any_traffic_of_one_direction_is_what_the_rules_say(seed: int, client: bool) -> None:
    check(of_one(conversations(seed), client=client), 10_000)


@examples(30)
@given(seed=st.integers(0, 20_000), client=st.booleans(), packets=st.integers(1, 90))
def test_so_it_is_however_it_is_cut(seed: int, client: bool, packets: int) -> None:
    check(of_one(conversations(seed), client=client), packets)


@pytest.mark.parametrize("port", [80, 8080])
def test_what_strangers_acknowledge_says_nothing_of_it(port: int) -> None:
    """Others, of which nothing but acknowledgements is captured, speak over such a port."""
    line = Line().segment(True).ask(WRITE)
    stranger = tcp_frame(line.now, ("10.0.0.9", port), CLIENT, ack=line.sent[False] + 5000)
    for frames in ([*line.frames, stranger], [stranger, *line.frames], [line.frames[0], stranger, line.frames[1]]):
        rows, findings = told(followed([batch_of(frames)]))
        assert (rows[0]["cut"], rows[0]["gap_bytes"]) == (0, 0)
        assert [one["code"] for one in findings] == ["NV801"]
