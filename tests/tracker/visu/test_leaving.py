"""Clients that close their side while they wait, where nothing comes over these ports behind that but time."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from dissectors.batch import PacketBatch
from nvscope.engine.told import Told
from nvscope.tracker.visu.messages import VisuBatch
from nvscope.tracker.visu.writes import WriteOutcome
from tests.oracle.builders import SECOND
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.oracle.tcp_line import Line, tcp_frame
from tests.packets import batch_of, cut, recorded
from tests.program_here import run_text
from tests.tracker.visu.followed import followed, told, writes_of
from tests.tracker.visu.test_endings import READ, REPLY, WRITE, figures, left, message, said
from tests.tracker.visu.test_names import OLD, listed, loads

RULE = '[[rule]]\nid = "a"\ncheck = "transaction"\nmax_unanswered = 0\n'


def other(time_ns: int) -> Frame:
    """Return a frame of which nobody asks anything but its time."""
    return tcp_frame(time_ns, ("10.0.0.8", 5000), ("10.0.0.9", 1202))


def closed_ns(line: Line) -> int:
    return line.frames[-2].ts_ns


def wrote() -> Line:
    return Line().open().ask(WRITE).segment(False).wait(SECOND).close(True).segment(False)


@pytest.mark.parametrize(("after_ns", "unanswered"), [(10 * SECOND - 1, 0), (10 * SECOND, 1), (10**15, 1)])
def test_time_tells_whatever_tells_the_time(after_ns: int, unanswered: int) -> None:
    line = left()
    frames = [*line.frames, other(closed_ns(line) + after_ns)]
    assert figures(frames) == (0, unanswered, 0)
    live = [batch_of(line.frames), PacketBatch.nothing(closed_ns(line) + after_ns)]
    assert told(followed(live)) == told(followed([batch_of(frames)]))
    if unanswered:
        assert message(frames).startswith("10.0.0.1 gave up 1 request to 10.0.0.5 without a reply after 1.0 s. If")


def test_it_is_told_where_the_client_leaves() -> None:
    read = "read 1 variable, no | at its end: 4,0,4,6"
    assert said(left().frames) == [read, "client closes its side, frame 4 waits for a reply"]
    assert said(left().answer(REPLY).frames)[-1] == "reply (1.0 s): 4,0,4,6 = 12.5"


class LastNames:
    """What variables are called for who is leaving, by the last batch that says so."""

    by_stream = False
    known: list[dict[Any, str]]

    def observe(self, told: Told) -> None:
        part = told.parts.get("visu")
        if part is not None:
            assert isinstance(part, VisuBatch)
            self.known = [dict(part.namings[one.naming].names) for one in part.leaving]


@pytest.mark.parametrize("packets", [1, 3, 100])
def test_the_names_of_who_leaves_are_those_of_lists_in_front_of_that_however_many_come_at_once(packets: int) -> None:
    line = Line().open()
    loads(line, listed(OLD))
    line.ask(WRITE).segment(False).wait(SECOND).close(True).segment(False)
    names = LastNames()
    followed(cut(batch_of(line.frames), packets), [names])
    assert [sorted(one.values()) for one in names.known] == [sorted(OLD)]


def test_a_write_is_unanswered_from_then_on() -> None:
    line = wrote()
    assert outcome(line.frames, 9) == WriteOutcome.OPEN
    assert outcome(line.frames, 10) == WriteOutcome.UNANSWERED
    twice = Line().open().ask(WRITE + WRITE).segment(False).close(True).segment(False)
    assert outcome(twice.frames, 10) == WriteOutcome.UNANSWERED


def outcome(frames: list[Frame], after_s: int) -> str:
    """Return what became of all writes, as a report says it."""
    state = followed([batch_of([*frames, other(frames[-2].ts_ns + after_s * SECOND)])])
    (row,), _ = told(state)
    writes = writes_of(state)
    ((found,),) = {row[8:9] for row in writes}
    assert row["unanswered"] == (len(writes) if found == WriteOutcome.UNANSWERED else 0)
    return str(found)


def test_what_was_told_stays_so() -> None:
    """A clock that was wrong is the capture's: a reply behind that is one to nobody, whoever has looked meanwhile."""
    line = wrote()
    wrong = other(closed_ns(line) + 60 * SECOND)
    late = line.wait(SECOND).answer(REPLY.replace(b"|12.5|", b"|0|").replace(b"6", b"3")).frames
    frames = [*late[:-1], wrong, late[-1]]
    assert figures(frames[:-1]) == figures(frames) == (0, 1, 0)
    live = [batch_of(late[:-1]), PacketBatch.nothing(closed_ns(line) + 9 * SECOND), batch_of(late[-1:])]
    assert told(followed(live))[0][0]["replies"] == 1


@pytest.mark.parametrize("shown", [[11], [15], [11, 12, 15]])
def test_it_was_over_after_ten_seconds_whatever_shows_it(shown: list[int]) -> None:
    line = left()
    end_ns = closed_ns(line)
    pages = [Line(("10.0.0.2", 50_000), now=end_ns + second * SECOND).open().frames for second in shown]
    for frames in ([*line.frames, *chain(*pages)], [*line.frames, other(end_ns + 10 * SECOND), *chain(*pages)]):
        assert figures(frames) == (0, 1, 0)
        _, (found,) = told(followed(cut(batch_of(frames), 2)))
        assert found["first_ns"] == found["last_ns"] == end_ns + 10 * SECOND


def test_whoever_is_heard_late_is_waited_for_from_then_on() -> None:
    """Ten seconds in which nothing of the server was captured tell nothing."""
    line = Line().ask(READ).close(True)
    end_ns = line.now
    frames = [*line.frames, *Line(("10.0.0.2", 50_000), now=end_ns + 11 * SECOND).open().frames]
    heard = line.wait(12 * SECOND).answer(REPLY[:9]).frames[-1]
    assert figures([*frames, heard]) == (0, 0, 0)
    assert figures([*frames, heard, other(end_ns + 13 * SECOND)]) == (0, 1, 0)


def test_of_who_is_answered_by_something_else_nobody_knows() -> None:
    line = left()
    end_ns = closed_ns(line) + 60 * SECOND
    assert figures([*line.answer(b"no HTTP at all, and more than a line\r\n").frames, other(end_ns)]) == (0, 0, 0)
    assert said(line.frames)[-1] == "nobody knows what answers frame 4"


def test_who_is_answered_in_malformed_chunks_waits_no_more() -> None:
    line = left().answer(b"HTTP/1.1 200\r\nTransfer-Encoding: chunked\r\n\r\nx\r\n")
    assert figures([*line.frames, other(closed_ns(line) + 60 * SECOND)]) == (0, 0, 1)


def test_frames_before_it_left_tell_nothing() -> None:
    early = other(99 * SECOND)
    assert figures([early, *left().frames]) == (0, 0, 0)
    assert figures([*left().frames[:5], early, *left().frames[5:]]) == (0, 0, 0)


def test_several_are_given_up_each_at_its_time() -> None:
    lines = [
        Line(("10.0.0.1", 50_100 - number), now=number * 7).open().ask(READ + READ).close(True) for number in range(8)
    ]
    frames = sorted((frame for line in lines for frame in line.frames), key=lambda frame: frame.ts_ns)
    assert figures([*frames, other(20 * SECOND)]) == (0, 16, 0)


def test_who_was_heard_later_leaves_too() -> None:
    line = Line().ask(READ).close(True).answer(REPLY[:20])
    assert figures([*line.frames, other(20 * SECOND)]) == (0, 1, 0)


def test_where_nobody_listened_nobody_knows() -> None:
    line = left()
    later = batch_of([other(closed_ns(line) + 60 * SECOND)])
    (row,), _ = told(followed(recorded([batch_of(line.frames)], [later])))
    assert row["unanswered"] == 0


def test_a_rule_fails_for_it(tmp_path: Path) -> None:
    line = left()
    (tmp_path / "a.rules.toml").write_text(RULE)
    for after_s, code in ((9, 3), (10, 1)):
        write_pcap([*line.frames, other(closed_ns(line) + after_s * SECOND)], tmp_path / "x.pcap")
        done = run_text("check", tmp_path / "x.pcap", tmp_path / "a.rules.toml")
        assert done.returncode == code, done.stdout
    assert "1 unanswered of 1 request" in " ".join(done.stdout.split())


def test_all_of_it_is_the_same_however_it_is_cut() -> None:
    line = wrote()
    frames = [*line.frames, *(other(closed_ns(line) + second * SECOND) for second in range(14))]
    assert {repr(told(followed(cut(batch_of(frames), packets)))) for packets in range(1, 12)} == {
        repr(told(followed([batch_of(frames)])))
    }
    assert {row[8] for row in writes_of(followed([batch_of(frames)]))} == {"unanswered"}
