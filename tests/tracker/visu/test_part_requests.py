"""Requests of which the client sent no more than a part: refused, unanswered, broken off, or cut by the capture."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.findings.judge import judge
from nvscope.protocols.table import judges_of
from nvscope.protocols.visu import VISU
from tests.analysis.transactions.test_transactions import transactions
from tests.laws import crossed, cut_sizes
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, OTHER, REFUSED
from tests.tracker.visu.test_endings import said
from tests.tracker.visu.test_open_requests import became

EXPECTS = HEAD.replace(b"\r\n\r\n", b"\r\nExpect: 100-continue\r\n\r\n")
READ = HEAD + b"|0|1|0|4|0|4|"
PART = "part of a write, the rest was never sent"


def row(frames: list[Frame]) -> dict[str, Any]:
    """Return the only row, by the rules, too, and the same however the frames are cut."""
    rules = by_the_rules(frames)
    for packets in (1, 2, len(frames)):
        state = followed(cut(batch_of(frames), packets))
        rows, findings = told(state)
        assert findings == rules.findings()
        assert writes_of(state) == writes_by_the_rules(rules)
        for one, other in zip(rows, rules.rows(), strict=True):
            assert {name: one[name] for name in other if name[-3:] != "_ns"} == {
                name: value for name, value in other.items() if name[-3:] != "_ns"
            }
    (found,) = rows
    return found


def counts(frames: list[Frame]) -> tuple[int, ...]:
    found = row(frames)
    assert (found["reads"], found["writes"], found["entries"]) == (0, 0, 0)
    return found["refused"], found["unanswered"], found["cut"]


def messages(frames: list[Frame]) -> list[str]:
    state = followed([batch_of(frames)])
    return [one.message for one in judge(state, judges=judges_of([VISU], state)) if one.code.startswith("NV8")]


@pytest.mark.parametrize("sent", [HEAD, HEAD + BODY[:2], HEAD + BODY[:9], READ])
@pytest.mark.parametrize("end", ["server closes", "server resets", "client resets", "client closes"])
def test_what_is_refused_before_it_is_whole_is_told(sent: bytes, end: str) -> None:
    line = Line().open().ask(sent).answer(REFUSED)
    line = line.close("client" in end) if "closes" in end else line.reset("client" in end)
    line = line.close("client" not in end) if "closes" in end else line
    writes = sent.startswith(HEAD + b"|1|")
    assert counts(line.frames) == (int(writes), 0, 0)
    what = "write" if writes else "request"
    (message,) = messages(line.frames)
    assert message.startswith(f"10.0.0.5 refused 1 {what} that was never sent whole by 10.0.0.1: ")
    assert message.endswith("HTTP status 413.")
    assert said(line.frames)[-1].startswith("HTTP status 413, frame ")


@pytest.mark.parametrize(
    ("first", "told"),
    [
        (READ.replace(b"19", b"15") + b"6|", "2 requests, reads among them,"),
        (HEAD + BODY[:9], "2 requests, writes among them,"), (HEAD, "2 requests that were never sent whole"),
    ],
)  # fmt: skip
def test_of_what_nobody_knows_it_is_not_said_that_it_reads(first: bytes, told: str) -> None:
    frames = Line().open().ask(first).answer(REFUSED).close(True).frames
    frames += Line(("10.0.0.1", 50_001), now=SECOND).open().ask(HEAD).answer(REFUSED).close(True).frames
    assert messages(frames) == [f"10.0.0.5 refused {told} by 10.0.0.1: HTTP status 413."]


@pytest.mark.parametrize("body", [BODY[:9], b""])
def test_what_the_server_ends_without_a_word_is_unanswered(body: bytes) -> None:
    for line in (
        Line().open().ask(HEAD + body).reset(False),
        Line().open().ask(HEAD + body).close(True).close(False),
    ):
        assert counts(line.frames) == (0, 1, 0)
        assert len(messages(line.frames)) == 1


def test_who_goes_when_the_server_has_gone_is_told_and_counts_nowhere() -> None:
    """As whole requests do that come when the server has closed its side: nobody knows what it had heard."""
    line = Line().open().ask(HEAD + BODY[:9]).close(False).close(True)
    assert counts(line.frames) == (0, 0, 0)
    assert said(line.frames)[0] == PART


def test_who_breaks_its_request_off_has_asked_for_nothing() -> None:
    line = Line().open().ask(HEAD + BODY[:9]).reset(True)
    assert counts(line.frames) == (0, 0, 0)
    assert said(line.frames) == [PART]


def test_at_the_end_of_a_capture_it_is_neither() -> None:
    frames = Line().open().ask(HEAD + BODY[:9]).answer(REFUSED).frames
    assert told(followed([batch_of(frames)])) == ([], [])


def test_a_server_may_refuse_what_its_client_has_ended() -> None:
    line = Line().open().ask(HEAD + BODY[:9]).close(True).answer(REFUSED).close(False)
    assert counts(line.frames) == (1, 0, 0)
    time_passes = Line().open().ask(HEAD + BODY[:9]).segment(False).close(True).wait(11 * SECOND).segment(False)
    assert counts(time_passes.frames) == (0, 1, 0)


def test_a_part_that_is_confirmed_was_not_done() -> None:
    line = Line().open().ask(HEAD + BODY[:9]).answer(DONE).close(False).close(True)
    assert counts(line.frames) == (0, 0, 0)
    assert messages(line.frames) == []
    assert said(line.frames) == [PART, "nobody knows what answers frame 7"]


def test_what_lacks_bytes_is_cut() -> None:
    line = Line().open().ask(HEAD).say(True, BODY[:9], captured=4).answer(REFUSED).close(False).close(True)
    assert counts(line.frames) == (0, 0, 1)


def test_of_other_pages_nothing_is_told() -> None:
    other = HEAD.replace(b"webvisu", b"other") + b"<xml>"
    assert told(followed([batch_of(Line().open().ask(other).answer(REFUSED).close(True).frames)])) == ([], [])


@pytest.mark.parametrize("cut_at", [0, 3, 40, 120])
def test_who_expects_to_go_on_and_is_refused_sends_no_body(cut_at: int) -> None:
    more = HEAD + OTHER
    line = Line().open().ask(EXPECTS).answer(REFUSED.replace(b"413", b"417"))
    line = (line.ask(more[:cut_at]) if cut_at else line).ask(more[cut_at:]).answer(DONE)
    assert became(line.frames) == [("8.5", "confirmed")]
    found = row(line.frames)
    assert (found["writes"], found["replies"], found["refused"]) == (1, 1, 0)
    assert len([one for one in messages(line.frames) if "HTTP status 417" in one]) == 1


@pytest.mark.parametrize(
    ("length", "blank", "behind", "cuts"),
    crossed(
        [b"Transfer-Encoding: chunked\r\n", b"Content-Length: 20\r\n", b""], [b"", b"\r\n", b"\r\n\r\n"],
        [HEAD + OTHER, b"GET / HTTP/1.1\r\n\r\n"], [(), (3,), (len(HEAD) + 2,)],
    ),
)  # fmt: skip
def test_no_body_was_sent_whatever_its_length_would_have_been(
    length: bytes, blank: bytes, behind: bytes, cuts: tuple[int, ...]
) -> None:
    start = HEAD.split(b"Content-Length")[0] + length + b"Expect: 100-continue\r\n\r\n"
    line = Line().open().ask(start).answer(REFUSED.replace(b"413", b"417"))
    more = blank + behind
    for begin, end in zip((0, *cuts), (*cuts, len(more)), strict=True):
        line.ask(more[begin:end])
    line.answer(DONE).ask(HEAD + BODY).answer(DONE)
    expected = [("8.5", "confirmed")] * (behind != b"GET / HTTP/1.1\r\n\r\n") + [("9.5", "confirmed")]
    for packets in cut_sizes(len(line.frames)):
        state = followed(cut(batch_of(line.frames), packets))
        assert [one[7:9] for one in writes_of(state)] == expected


def test_who_expects_to_go_on_and_may_sends_the_body() -> None:
    for interim in (b"HTTP/1.1 100 Continue\r\n\r\n", b""):
        line = Line().open().ask(EXPECTS)
        line = (line.answer(interim) if interim else line).ask(BODY).answer(DONE).ask(HEAD + OTHER).answer(DONE)
        assert became(line.frames) == [("9.5", "confirmed"), ("8.5", "confirmed")]


@pytest.mark.parametrize("together", [True, False])
def test_a_reply_to_head_from_before_the_capture_is_not_that_of_a_write(together: bool) -> None:
    """It is known to have no body with the next reply alone, and the write was asked between both."""
    to_head = b"HTTP/1.1 200 OK\r\nContent-Length: 170\r\n\r\n"
    line = Line().answer(to_head).ask(HEAD + BODY)
    line = line.answer(DONE) if together else line.answer(DONE[:5]).answer(DONE[5:])
    assert became(line.ask(HEAD + OTHER).answer(DONE).frames) == [("9.5", "confirmed"), ("8.5", "confirmed")]
    assert row(line.frames)["refused"] == 0


def test_the_transactions_know_it() -> None:
    found = transactions(Line().open().ask(HEAD + BODY[:9]).answer(REFUSED).close(False).close(True).frames)
    assert [(one.writes, one.outcome.value, one.detail, len(one.said)) for one in found] == [
        (True, "refused", "HTTP status 413", 0)
    ]


def test_an_empty_request_behind_a_part_is_no_write_of_before() -> None:
    refused = b"HTTP/1.1 417 n\r\nContent-Length: 0\r\n\r\n"
    line = Line().open().ask(HEAD + BODY).answer(DONE).ask(EXPECTS).answer(refused)
    frames = line.ask(HEAD.replace(b"19", b"0")).answer(REFUSED).frames
    assert row(frames)["writes"] == 1
    assert [outcome for _, outcome in became(frames)] == ["confirmed"]


@pytest.mark.parametrize("length", [b"Content-Length: x\r\n", b"Transfer-Encoding: chunked\r\n", b""])
@pytest.mark.parametrize("asked_before", [b"", b"HEAD /plc/x HTTP/1.1\r\n\r\n"])
def test_what_answers_it_comes_before_what_shows_that_it_has_no_body(length: bytes, asked_before: bytes) -> None:
    """In which frame it is told is that of the answer, whichever batch has the next request."""
    start = HEAD.split(b"Content-Length")[0] + length + b"Expect: 100-continue\r\n\r\n"
    answers = (b"HTTP/1.1 304 n\r\nContent-Length: 19\r\n 20\r\n\r\n" if asked_before else b"") + DONE
    for before in (Line(), Line().open()):
        line = (before.ask(asked_before) if asked_before else before).ask(start[:18]).ask(start[18:])
        for behind in (HEAD + OTHER, b"HEAD /plc/x HTTP/1.1\r\n\r\n"):
            line = line.answer(answers).ask(behind).answer(DONE).ask(start)
        rules = by_the_rules(line.frames)
        for packets in cut_sizes(len(line.frames)):
            state = followed(cut(batch_of(line.frames), packets))
            assert told(state)[1] == rules.findings()
            assert writes_of(state) == writes_by_the_rules(rules)


def test_who_closed_its_side_with_a_part_did_not_wait_for_no_time() -> None:
    first = Line().open().ask(HEAD + BODY[:9]).segment(False).close(True).frames
    second = Line(("10.0.0.1", 50_001), now=SECOND).open().ask(HEAD + BODY).wait(2 * SECOND).segment(False).close(True)
    frames = [*first, *second.wait(11 * SECOND).segment(False).frames]
    (told_of,) = [one for one in messages(frames) if "gave up" in one]
    assert told_of.startswith("10.0.0.1 gave up 2 requests to 10.0.0.5 without a reply after up to 2.0 s.")
