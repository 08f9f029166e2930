"""Requests that stay without a reply: who ended the connection, and when it is sure that nobody waits any more."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.engine.run import run
from nvscope.findings.judge import judge
from nvscope.protocols.table import judges_of
from nvscope.protocols.visu import VISU
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.view.lines.visu_words import message_words
from tests.oracle.builders import MILLISECOND, SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp import ACK, FIN, SYN
from tests.oracle.tcp_line import CLIENT, SERVER, Line, tcp_frame
from tests.packets import Batches, batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, reading, told, writes_by_the_rules, writes_of

READ = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 14\r\n\r\n|0|1|0|4|0|4|6"
WRITE = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 18\r\n\r\n|1|1|0|4|0|4|6|9.5"
REPLY = b"HTTP/1.1 200 OK\r\nContent-Length: 6\r\n\r\n|12.5|"
ANOTHER = ("10.0.0.1", 50_001)


def figures(frames: list[Frame]) -> tuple[int, int, int]:
    """Return how many replies there are, how many requests are unanswered, and how many are cut: by the rules, too."""
    rules = by_the_rules(frames)
    for packets in (1, 2, len(frames)):
        state = followed(cut(batch_of(frames), packets))
        rows, findings = told(state)
        assert [counts(row) for row in rows] == [counts(row) for row in rules.rows()]
        assert findings == rules.findings()
        assert writes_of(state) == writes_by_the_rules(rules)
    (row,) = rows
    return counts(row)


def counts(row: dict[str, Any]) -> tuple[int, int, int]:
    return row["replies"], row["unanswered"], row["cut"]


def message(frames: list[Frame]) -> str:
    """Return what the only finding says, and what to do next."""
    state = followed([batch_of(frames)])
    (found,) = [one for one in judge(state, judges=judges_of([VISU], state)) if one.code == "NV805"]
    return f"{found.message} {found.hint}"


def left(wait_ns: int = SECOND) -> Line:
    """Return a connection whose client closes its side where nothing comes."""
    return Line().open().ask(READ).segment(False).wait(wait_ns).close(True).segment(False)


def opened(time_ns: int, client: tuple[str, int] = ANOTHER) -> Frame:
    return tcp_frame(time_ns, client, SERVER, flags=SYN)


def test_a_client_that_closed_its_side_may_still_be_answered() -> None:
    assert figures(left().frames) == (0, 0, 0)
    assert figures(left().answer(REPLY).frames) == (1, 0, 0)
    assert figures(left().wait(9 * SECOND).answer(REPLY).frames) == (1, 0, 0)


@pytest.mark.parametrize(("after_ns", "unanswered"), [(SECOND - 1, 0), (SECOND, 1)])
def test_who_opens_another_connection_waits_no_more(after_ns: int, unanswered: int) -> None:
    line = left()
    closed_ns = line.frames[-2].ts_ns
    assert figures([*line.frames, opened(closed_ns + after_ns)])[1] == unanswered
    assert figures([*line.frames, opened(closed_ns + after_ns, ("10.0.0.2", 50_001))])[1] == 0
    assert figures([*line.frames, tcp_frame(closed_ns + after_ns, CLIENT, SERVER, flags=ACK)])[1] == 0


@pytest.mark.parametrize(("after_ns", "unanswered"), [(10 * SECOND - 1, 0), (10 * SECOND, 1)])
def test_of_who_asks_no_more_time_tells(after_ns: int, unanswered: int) -> None:
    line = left()
    closed_ns = line.frames[-2].ts_ns
    others = tcp_frame(closed_ns + after_ns, ("10.0.0.2", 50_000), SERVER)
    assert figures([*line.frames, others])[1] == unanswered
    late = line.wait(closed_ns + after_ns - line.now).answer(REPLY)
    assert figures(late.frames) == (1 - unanswered, unanswered, 0)


def test_times_that_go_back_change_nothing() -> None:
    line = left()
    early = opened(20 * SECOND)._replace(ts_ns=20 * SECOND)
    assert figures([early, *line.frames]) == (0, 0, 0)
    assert figures([*line.frames, opened(3 * SECOND), opened(2 * SECOND)]) == (0, 1, 0)


def test_several_are_given_up_with_one_frame() -> None:
    frames = [
        frame for number in range(14)
        for frame in Line(("10.0.0.1", 50_100 - number), now=number).open().ask(READ).close(True).frames
    ]  # fmt: skip
    frames.sort(key=lambda frame: frame.ts_ns)
    assert figures([*frames, opened(5 * SECOND)]) == (0, 14, 0)


def test_a_server_that_hangs_is_no_news_of_its_own() -> None:
    frames = [
        frame for number in range(3)
        for frame in Line(("10.0.0.1", 50_000 + number), now=number * 3 * SECOND).open().ask(READ).segment(False)
        .wait(SECOND).close(True).segment(False).frames
    ]  # fmt: skip
    assert figures(frames) == (0, 2, 0)
    assert message(frames).startswith("10.0.0.1 gave up 2 requests to 10.0.0.5 without a reply after 1.0 s. If it ")


@pytest.mark.parametrize("end", [Line.reset, Line.close])
def test_who_ended_the_connection_is_told(end: object) -> None:
    asked = Line().open().ask(READ).wait(499 * MILLISECOND)
    assert callable(end)
    by_client = end(asked, True).close(False)
    gave_up = "10.0.0.1 gave up 1 request to 10.0.0.5 without a reply after 500.0 ms. If it answers nobody"
    assert message(by_client.frames).startswith(gave_up)
    by_server = end(Line().open().ask(READ).wait(499 * MILLISECOND), False)
    verb = "reset" if end is Line.reset else "ended"
    ended = f"10.0.0.5 {verb} the connection without a reply to 1 request of 10.0.0.1. If it ends connections"
    assert message(by_server.frames).startswith(ended)
    assert said(by_server.frames)[-1] == f"no reply to frame 4, connection {verb} by the controller"


def test_behind_another_connection_between_the_same_ends_nobody_knows_how_the_one_before_ended() -> None:
    frames = [*Line().open().ask(READ).frames, tcp_frame(3 * SECOND, CLIENT, SERVER, seq=77, flags=SYN)]
    assert figures(frames) == (0, 0, 0)
    assert told(followed([batch_of(frames)]))[1] == by_the_rules(frames).findings() == []


def test_who_closes_its_side_with_its_request_waits_for_the_reply() -> None:
    line = Line().open()
    line.say(True, READ, flags=ACK | FIN)
    line.lose(True, 1)
    assert "10.0.0.5 ended the connection" in message(line.wait(SECOND).close(False).frames)


def test_where_nothing_of_the_server_was_captured_nobody_knows_whether_it_answered() -> None:
    frames = [frame for frame in left().frames if frame.data[34:36] == (50_000).to_bytes(2, "big")]
    assert figures([*frames, opened(20 * SECOND)]) == (0, 0, 0)


def test_a_reply_that_was_not_sent_whole_is_none() -> None:
    for asked in (READ, WRITE):
        line = Line().open().ask(asked).answer(REPLY[:-2]).wait(SECOND).close(False).close(True)
        assert figures(line.frames) == (0, 1, 0)
        assert "10.0.0.5 ended the connection" in message(line.frames)


def test_a_reply_of_which_bytes_are_missing_is_cut() -> None:
    line = Line().open().ask(READ).say(False, REPLY[:-2], captured=len(REPLY) - 4).close(False)
    assert figures(line.frames) == (0, 0, 1)


@pytest.mark.parametrize("coding", [b"br", b"gzip"])
def test_a_reply_that_cannot_be_read_is_one_and_its_coding_is_named(coding: bytes) -> None:
    coded = REPLY.replace(b"\r\n\r\n", b"\r\nContent-Encoding: %b\r\n\r\n" % coding)
    for asked in (READ, WRITE):
        line = Line().open().ask(asked).answer(coded).close(False).close(True)
        assert figures(line.frames) == (1, 0, 0)
        assert said(line.frames)[-1] == f"reply not read, Content-Encoding {coding.decode()} (1.0 ms)"
        assert all(outcome == "open" for *_, outcome, _, _ in writes_of(followed([batch_of(line.frames)])))


def said(frames: list[Frame]) -> list[str]:
    """Return what `packets` says of all messages."""
    found: list[str] = []
    for batch in run(Batches([batch_of(frames)]), reading(), []):
        part = batch.parts["visu"]
        assert isinstance(part, VisuBatch)
        found += [message_words(part, one) for one in range(len(part.messages))]
    return found
