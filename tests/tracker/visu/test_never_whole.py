"""Requests that never become whole, in topics and rules; and telegrams between the segments of messages."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.analysis.transactions.rows import transaction_row
from nvscope.analysis.transactions.transaction import Group
from nvscope.check.verdict import Verdict
from nvscope.engine.run import run
from nvscope.view.display_filter import DisplayFilter, PacketChoice
from nvscope.view.fields.frame import FIELDS
from nvscope.view.fields.visu import VISU_FIELDS
from nvscope.view.fields.vocabulary import vocabulary
from nvscope.view.lines.plant.transactions import what
from tests.analysis.transactions.test_transactions import transactions
from tests.check.requests import WRITE_X, decided, page, reply, sent
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of, cut
from tests.record.test_transaction_topics import noted
from tests.tracker.visu.drawn_http import drawn
from tests.tracker.visu.followed import by_the_rules, followed, reading, writes_by_the_rules, writes_of
from tests.tracker.visu.test_early import BODY, DONE, HEAD, REFUSED

LONGER = HEAD.replace(b"19", b"20")
ODD = HEAD.replace(b"19", b"19, 20")
ENDS = ["server closes", "server resets", "client closes"]
NOBODY = {"check": "writes", "only_by": "192.0.2.1"}


def ended(line: Line, end: str) -> list[Frame]:
    line = line.close("client" in end) if "closes" in end else line.reset("client" in end)
    return line.close("client" not in end).frames


def chosen(frames: list[Frame], words: str) -> list[bool]:
    """Return of the frames of messages which of them a display filter chooses."""
    found: list[bool] = []
    choose = PacketChoice(DisplayFilter(words, vocabulary(fields=(*FIELDS.values(), *VISU_FIELDS))))
    for told in run(Batches([batch_of(frames)]), reading(), []):
        found += choose(told).tolist()
    return found


def topics_of(frames: list[Frame]) -> list[tuple[Any, ...]]:
    """Return what topics tell, the same however the frames come."""
    found = [noted(cut(batch_of(frames), packets)).messages_of for packets in (1, 2, len(frames))]
    assert found[0] == found[1] == found[2]
    return [(one["operation"], one["outcome"], one["values"]) for _, one, _, _ in found[0]]


@pytest.mark.parametrize("end", ENDS)
def test_topics_tell_what_became_of_a_part(end: str) -> None:
    assert topics_of(ended(Line().open().ask(LONGER + BODY).answer(REFUSED), end)) == [("write", "refused", {})]
    assert topics_of(ended(Line().open().ask(LONGER + BODY).answer(DONE), end)) == []


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("body", [b"", b"|", b"|0|1|0|4|"])
def test_what_does_not_say_that_it_writes_is_not_told_to_read(end: str, body: bytes) -> None:
    frames = ended(Line().open().ask(LONGER + body).answer(REFUSED), end)
    assert topics_of(frames) == [("unknown", "status", {})]
    (one,) = transactions(frames)
    row = transaction_row(one)
    assert (row["operation"], what(row), one.group) == ("unknown", "never sent whole", Group.WRONG)
    for words in ("visu.variables == 0", "visu.declared == 0", 'visu.kind == "read"'):
        assert not any(chosen(frames, words))
    assert any(chosen(frames, 'visu.kind == "part"'))


def test_topics_tell_a_write_of_unknown_length_as_any_other() -> None:
    frames = Line().open().ask(ODD + BODY).answer(DONE).frames
    assert [(one[0], one[1]) for one in topics_of(frames)] == [("write", "open"), ("write", "confirmed")]


def verdicts(frames: list[Frame], rule: dict[str, Any]) -> set[Verdict]:
    """Return the verdicts on all that a rule is about, the same however the frames come."""
    frames = [*frames, sent(frames[-1].ts_ns / 1e6 + 2000)]
    found = []
    for packets in (1, 3, len(frames)):
        (one,) = decided(cut(batch_of(frames), packets), rule)
        found.append({each.verdict for each in one.subjects})
    assert found[0] == found[1] == found[2]
    return found[0]


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("answer", [REFUSED, reply(b"|0|")])
def test_a_part_is_no_write_for_a_rule(end: str, answer: bytes) -> None:
    part = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 99\r\n\r\n" + WRITE_X
    assert Verdict.FAIL not in verdicts(ended(page().ask(part).answer(answer), end), NOBODY)


def test_a_write_of_unknown_length_is_one_and_a_part_of_such_leaves_it_open() -> None:
    odd = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 3, 4\r\n\r\n"
    assert Verdict.FAIL in verdicts(page().ask(odd + WRITE_X).answer(reply(b"|0|")).frames, NOBODY)
    frames = page().ask(odd + WRITE_X[:-4]).answer(reply(b"|0|")).frames
    assert verdicts(frames, NOBODY) == {Verdict.INCONCLUSIVE}


def test_bytes_that_came_as_others_leave_open_what_was_written() -> None:
    line = page()
    read = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 18\r\n\r\n|0|1|0|4|144|1|0|1"
    line.ask(read).segment(True, read.replace(b"|0|1|0", b"|1|1|0"), seq=line.sent[True] - len(read))
    assert verdicts(line.answer(reply(b"|1|")).frames, NOBODY) == {Verdict.INCONCLUSIVE}


@examples(150)
@given(seed=st.integers(0, 10**6), packets=st.integers(1, 9))
def test_telegrams_between_segments_change_nothing(seed: int, packets: int) -> None:
    frames = drawn(seed).frames()
    between = [one for frame in frames for one in (sent(frame.ts_ns / 1e6)._replace(ts_ns=frame.ts_ns), frame)]
    alone = [(*row[:1], *row[2:9], *row[10:]) for row in writes_of(followed([batch_of(frames)]))]
    found = writes_of(followed(cut(batch_of(between), packets)))
    assert found == writes_by_the_rules(by_the_rules(between))
    assert [(*row[:1], *row[2:9], *row[10:]) for row in found] == alone
