"""Bytes that come again and are others: what came first counts, and it is told that there were others."""

from __future__ import annotations

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.tracker.other_copies import REACH_BYTES
from nvscope.view.lines.plant.visu import remarks
from tests.laws import cut_sizes, examples
from tests.oracle.builders import SECOND
from tests.oracle.tcp import SYN
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, told, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD
from tests.tracker.visu.test_endings import said

WRITE = HEAD + BODY
FORGED = HEAD + BODY.replace(b"9.5", b"1.7")
AGAIN = "sent again with other bytes (2 bytes): what came first is shown, the receiver may have the others"


def other_bytes(line: Line) -> int:
    """Return how many are told: by the rules, too, and the same however the frames are cut."""
    rules = by_the_rules(line.frames)
    for packets in cut_sizes(len(line.frames)):
        state = followed(cut(batch_of(line.frames), packets))
        rows, findings = told(state)
        assert findings == rules.findings()
        assert writes_of(state) == writes_by_the_rules(rules)
        assert [one["other_bytes"] for one in rows] == [one["other_bytes"] for one in rules.rows()]
    (row,) = rows
    number: int = row["other_bytes"]
    return number


def again(line: Line, data: bytes, back: int, from_client: bool = True, **more: Any) -> Line:
    return line.segment(from_client, data, seq=line.sent[from_client] - back, **more)


def test_a_copy_with_other_bytes_is_told_with_its_frame() -> None:
    line = again(Line().open().ask(WRITE), FORGED, len(WRITE)).answer(DONE)
    assert other_bytes(line) == 2
    assert [row[7] for row in writes_of(followed([batch_of(line.frames)]))] == ["9.5"]
    assert said(line.frames)[1] == AGAIN
    assert said(line.frames[:4] + line.frames[5:])[1:2] != [AGAIN]


def test_the_same_copy_is_not() -> None:
    for size in (len(WRITE), 5, 1):
        assert other_bytes(again(Line().open().ask(WRITE), WRITE[-size:], size).answer(DONE)) == 0


def test_a_byte_that_asks_whether_somebody_is_there_is_not() -> None:
    assert other_bytes(again(Line().open().ask(WRITE), b"\0", 1).answer(DONE)) == 0
    assert other_bytes(again(Line().open().ask(WRITE), b"\0", 2).answer(DONE)) == 1


def one_way(before: int) -> Line:
    """Return a client that nobody is seen to answer, of whose last write but one the begin was not captured."""
    line = Line().segment(True, flags=SYN, seq=Line().begin[True] - 1, ack=0)
    for _ in range(before):
        line.ask(WRITE)
    return line.lose(True, 9).ask(WRITE[9:]).ask(WRITE[:40]).ask(WRITE[40:])


@pytest.mark.parametrize("before", [1, 3, 140])
@pytest.mark.parametrize(
    ("back", "told_as"),
    [(1, 0), (2, 1), (len(WRITE) - 40, 1), (len(WRITE) - 39, 1), (2 * len(WRITE) - 9, 1), (2 * len(WRITE) + 1, 1)],
)
def test_so_one_asks_while_bytes_wait_behind_a_hole(before: int, back: int, told_as: int) -> None:
    """Nothing says that the missing ones had come, and it asks again and again; a byte at another place is another."""
    line = one_way(before)
    for _ in range(3):
        line = again(line.wait(2 * SECOND), b"\0", back)
    assert other_bytes(line.wait(5 * SECOND).ask(WRITE)) == 3 * told_as


def test_behind_an_end_that_waits_the_last_byte_asks_nothing() -> None:
    """The end takes a place: who asks does so with that."""
    assert other_bytes(again(one_way(1).close(True).wait(SECOND), b"\0", 1)) == 0
    assert other_bytes(again(one_way(1).close(True).wait(SECOND), b"\0", 2)) == 1


@pytest.mark.parametrize("more", [b"", b"GET / HTTP/1.1\r\n\r\n"])
def test_a_copy_may_overlap_in_part(more: bytes) -> None:
    line = again(Line().open().ask(WRITE), FORGED[-6:] + more, 6)
    assert other_bytes(line.lose(True, len(more)).answer(DONE)) == 2


def test_it_may_differ_from_what_waits_behind_a_hole() -> None:
    line = Line().open()
    begin = line.sent[True]
    line.segment(True, WRITE[30:], seq=begin + 30).segment(True, FORGED[40:], seq=begin + 40)
    line.segment(True, WRITE[:30], seq=begin).lose(True, len(WRITE)).answer(DONE)
    assert other_bytes(line) == 2


def test_of_what_was_not_captured_nothing_is_said() -> None:
    line = Line().open().say(True, WRITE, captured=len(HEAD) + 4)
    assert other_bytes(again(line, FORGED, len(WRITE)).answer(DONE)) == 0
    short = again(Line().open().ask(WRITE), FORGED, len(WRITE), captured=len(WRITE) - 2)
    assert other_bytes(short.answer(DONE)) == 1


def test_so_may_a_reply_and_far_behind_nothing_is_compared() -> None:
    line = Line().open().ask(WRITE).answer(DONE)
    assert other_bytes(again(line, b"|1|", 3, from_client=False)) == 1
    long = Line().open().ask(WRITE).answer(DONE)
    many = REACH_BYTES // len(WRITE) + 2
    for _ in range(many):
        long.ask(WRITE).answer(DONE)
    assert other_bytes(again(long, FORGED, len(WRITE) * many)) == 0
    assert other_bytes(again(long, FORGED, len(WRITE) * (many // 2))) == 2


def test_the_report_says_so() -> None:
    rows, _ = told(followed([batch_of(again(Line().open().ask(WRITE), FORGED, len(WRITE)).answer(DONE).frames)]))
    named = [{**row, "client_name": None, "server_name": "press"} for row in rows]
    (remark,) = remarks({"visu": named, "lists": []})
    assert remark.startswith("10.0.0.1 and press: 2 bytes came again as others. What came first is shown;")


@examples(200)
@given(seed=st.integers(0, 10**6))
def test_however_segments_overlap_the_rules_say_the_same(seed: int) -> None:
    rng = random.Random(seed)
    data = b"".join(HEAD + b"|1|1|0|4|0|4|6|%d.5|" % number for number in range(rng.randint(1, 9)))
    line, most = Line(isn=(2**32 - 300, 7)).open(), 0
    begin = line.sent[True]
    while most < len(data):
        at = rng.randint(max(most - 90, 0), min(most + rng.choice((0, 0, 0, 40)), len(data)))
        part = bytearray(data[at : at + rng.choice((1, rng.randint(1, 120)))])
        if part and rng.random() < 0.3:
            part[rng.randrange(len(part))] ^= 1
        most = max(most, at + len(part))
        line.segment(True, bytes(part), seq=begin + at)
        if rng.random() < 0.3:
            line.segment(True, b"\0", seq=begin + most - rng.choice((1, 1, 2)))
    rules = by_the_rules(line.frames)
    for packets in (1, rng.randint(2, 9), len(line.frames)):
        rows, findings = told(followed(cut(batch_of(line.frames), packets)))
        assert findings == rules.findings()
        assert [one["other_bytes"] for one in rows] == [one["other_bytes"] for one in rules.rows()]
