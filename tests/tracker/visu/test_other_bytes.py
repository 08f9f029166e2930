"""Whose bytes that came again as others are told: those of connections that are, or may be, a page's."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.check.verdict import Verdict
from nvscope.engine.run import run
from nvscope.tracker.visu.messages import Kind, VisuBatch
from tests.laws import every_other, examples
from tests.oracle.frame import Frame
from tests.oracle.rules.visu_others import other_bytes
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of, cut
from tests.tracker.visu.followed import by_the_rules, followed, reading, told
from tests.tracker.visu.test_early import BODY, DONE, HEAD
from tests.tracker.visu.test_endings import said
from tests.tracker.visu.test_never_whole import NOBODY, verdicts

WRITE = HEAD + BODY
PICTURE = b"GET /plc/a.gif HTTP/1.1\r\nAccept: */*\r\nHost: press.example\r\nUser-Agent: a-panel/1.0\r\n\r\n"
OK = b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nGIF8"
QUERY = b"GET /WRITEPI?ADR1=MW230&VALUE1=12 HTTP/1.1\r\n\r\n"

Told = list[tuple[int, Kind, int, int]]
"""Frame, kind, how many bytes, and the frame of before, if it is another one."""


def packets(frames: list[Frame], at_a_time: int) -> Told:
    found: Told = []
    for batch in run(Batches(cut(batch_of(frames), at_a_time)), reading(), []):
        part = batch.parts.get("visu")
        if isinstance(part, VisuBatch):
            one = part.messages
            columns = (one.row + batch.first_frame, one.kind, one.fields, one.asked_frame)
            rows = zip(*(column.tolist() for column in columns), strict=True)
            found += [(frame, Kind(kind), size, first) for frame, kind, size, first in rows if kind in BOTH]
    return found


BOTH = (Kind.OTHER_BYTES, Kind.OTHER_REPLY_BYTES)


def what_is_told(frames: list[Frame]) -> Told:
    """Return what `packets` tells: as much as the report, and the rules, and the same however the frames are cut."""
    rules = by_the_rules(frames)
    whole = packets(frames, len(frames))
    for at_a_time in every_other(1, 2, 3, len(frames)):
        rows, findings = told(followed(cut(batch_of(frames), at_a_time)))
        assert packets(frames, at_a_time) == whole
        assert [one["other_bytes"] for one in rows] == [one["other_bytes"] for one in rules.rows()]
        assert findings == rules.findings()
    by_side = dict.fromkeys(BOTH, 0)
    for _, kind, size, _ in whole:
        by_side[kind] += size
    for kind, side in zip(BOTH, (True, False), strict=True):
        assert by_side[kind] == sum(other_bytes(rules.talks.values(), pair, (side,)) for pair in rules.known)
    return whole


def again(line: Line, from_client: bool, said: bytes, at: int, as_others: bytes) -> Line:
    """Say once more what was said last, with other bytes from a place on."""
    copy = said[:at] + as_others + said[at + len(as_others) :]
    return line.segment(from_client, copy, seq=line.sent[from_client] - len(said))


def test_what_is_no_pages_is_not_told() -> None:
    line = again(Line().open().ask(PICTURE), True, PICTURE, 9, b"b").answer(OK)
    frames = again(line, False, OK, len(OK) - 4, b"PNG").frames
    assert what_is_told(frames) == []
    assert verdicts(frames, NOBODY) == {Verdict.PASS}


def test_what_came_before_the_first_request_is_told_with_that() -> None:
    line = again(Line().open().ask(PICTURE), True, PICTURE, 9, b"b").answer(OK)
    line = again(line, False, OK, len(OK) - 4, b"PNG")
    assert what_is_told(line.frames) == []
    line = line.ask(WRITE[:50])
    line = again(line, True, WRITE[:50], 48, b"5").ask(WRITE[50:])
    assert what_is_told(line.frames) == [(10, Kind.OTHER_BYTES, 2, 5), (10, Kind.OTHER_REPLY_BYTES, 3, 7)]
    line = again(line.answer(DONE), True, WRITE[-5:], 0, b"8")
    assert what_is_told(line.frames)[2:] == [(len(line.frames), Kind.OTHER_BYTES, 1, 0)]
    assert said(line.frames)[1].startswith("since frame 5, the client sent again with other bytes (2 bytes): what ")


def test_what_may_have_been_a_request_is_told_at_once() -> None:
    for copy in (WRITE, b"x: y\r\n\r\n" + BODY, BODY, QUERY):
        line = again(Line().open().ask(PICTURE), True, PICTURE, 20, b"#")
        assert what_is_told(line.frames) == []
        line.segment(True, copy, seq=line.sent[True] - len(PICTURE))
        (one, *_) = what_is_told(line.frames)
        assert (*one[:2], one[3]) == (6, Kind.OTHER_BYTES, 5)
        assert verdicts(line.frames, NOBODY) == {Verdict.INCONCLUSIVE}
        line = again(line.answer(OK), False, OK, len(OK) - 4, b"PNG")
        assert what_is_told(line.frames)[1:] == [(8, Kind.OTHER_REPLY_BYTES, 3, 0)]


def test_another_connection_between_the_same_ends_is_another() -> None:
    line = Line().open().ask(WRITE).answer(DONE).reset(True)
    line = again(Line(isn=(90_000, 80_000), now=line.now).open().ask(PICTURE), True, PICTURE, 9, b"b")
    before = Line().open().ask(WRITE).answer(DONE).reset(True).frames
    assert what_is_told([*before, *line.answer(OK).frames]) == []
    assert len(what_is_told([*before, *line.ask(WRITE).frames])) == 1


@pytest.mark.parametrize(("side", "verdict"), [(True, Verdict.INCONCLUSIVE), (False, Verdict.PASS)])
def test_what_a_controller_sends_again_hides_no_write(side: bool, verdict: Verdict) -> None:
    read, value = HEAD.replace(b"19", b"15") + b"|0|1|0|4|0|4|6|", DONE.replace(b"|0|", b"|5|")
    line = Line().open().ask(read).answer(value)
    line = again(line, side, read if side else value, len(read if side else value) - 2, b"7")
    assert len(what_is_told(line.frames)) == 1
    assert verdicts(line.frames, NOBODY) == {verdict}


@examples(150)
@given(seed=st.integers(0, 10**6))
def test_however_a_capture_is_cut_the_same_is_told(seed: int) -> None:
    rng = random.Random(seed)
    lines = [Line(("10.0.0.1", 50_000 + number), now=number).open() for number in range(rng.randint(1, 3))]
    for _ in range(rng.randint(3, 12)):
        line = rng.choice(lines)
        asked, answered = rng.choice(((PICTURE, OK), (PICTURE, OK), (WRITE, DONE), (WRITE[:60], b"")))
        for side, text in ((True, asked), (False, answered)):
            for begin in range(0, len(text), 50) if rng.random() < 0.5 else ():
                part = text[begin : begin + 50]
                line.say(side, part)
                if rng.random() < 0.3:
                    other = rng.choice((part[:-1] + b"\1", b"\1" * len(part), WRITE[-len(part) :]))
                    line.segment(side, other, seq=line.sent[side] - len(part))
        if rng.random() < 0.15:
            line.reset(rng.random() < 0.5)
            lines[lines.index(line)] = again_open(line, rng)
        if rng.random() < 0.2:
            line.lose(rng.random() < 0.5, 20)
    frames = [frame for line in {id(one): one for one in lines}.values() for frame in line.frames]
    what_is_told(sorted(frames, key=lambda frame: frame.ts_ns))


def again_open(line: Line, rng: random.Random) -> Line:
    """Return another connection between the same ends, behind the frames of one."""
    other = Line(line.ends[True], isn=(rng.getrandbits(32), rng.getrandbits(32)), now=line.now).open()
    other.frames = [*line.frames, *other.frames]
    return other
