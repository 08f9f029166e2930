"""Frames with which several messages of a page are whole: a filter asks for any of them, and -T fields writes all."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nvscope.engine.run import run
from nvscope.engine.told import Told
from nvscope.view.display_filter import DisplayFilter, PacketChoice
from nvscope.view.fields.frame import FIELDS
from nvscope.view.fields.frame_messages import MOST_MESSAGES
from nvscope.view.fields.visu import VISU_FIELDS, visu_fields
from nvscope.view.fields.vocabulary import vocabulary
from nvscope.view.lines.cells import json_texts, texts
from nvscope.view.rows.frames import FrameRows
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of
from tests.tracker.visu.followed import reading
from tests.tracker.visu.test_endings import said

HEAD = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n"


def post(body: bytes) -> bytes:
    return HEAD % len(body) + body


def answer(body: bytes, status: bytes = b"200 OK") -> bytes:
    return b"HTTP/1.1 " + status + b"\r\nContent-Length: %d\r\n\r\n" % len(body) + body


READ = post(b"|0|1|0|4|0|2|1|")
WRITE = post(b"|1|1|0|4|10|2|1|99|")
SECRET = post(b"|1|1|0|4|20|9|8|secret|")


def told_of(frames: Sequence[Frame]) -> list[Told]:
    return list(run(Batches([batch_of(frames)]), reading(), []))


def chosen(frames: Sequence[Frame], words: str) -> list[int]:
    """Return the numbers of the frames that a display filter chooses."""
    known = vocabulary(fields=(*FIELDS.values(), *VISU_FIELDS))
    choose = PacketChoice(DisplayFilter(words, known))
    return [row + 1 for told in told_of(frames) for row, is_chosen in enumerate(choose(told).tolist()) if is_chosen]


def cells(frames: Sequence[Frame], name: str, *, secrets: bool = False) -> dict[int, str]:
    """Return what -T fields writes of the frames of messages, by their numbers."""
    field = next(one for one in visu_fields(secrets=secrets) if one.name == name)
    found: dict[int, str] = {}
    for told in told_of(frames):
        packets = told.parts["visu"].row
        found |= dict(zip((packets + 1).tolist(), texts(field, FrameRows.of(told, packets)), strict=True))
    return found


def both() -> list[Frame]:
    """Return a read and a write in one segment, the fourth frame, and their replies in the fifth one."""
    return Line().open().ask(READ + WRITE).answer(answer(b"|1|") + answer(b"|0|")).frames


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ('visu.kind == "read"', [4]),
        ('visu.kind == "write"', [4]),
        ('visu.kind != "write"', [5]),
        ('visu.kind in {"write", "part"}', [4]),
        ('visu.variable == "4,10,2,1"', [4, 5]),
        ("visu.index == 0", [4, 5]),
        ("visu.index > 0", []),
        ('visu.value == "99"', [4]),
        ('visu.value == "0X63"', []),
        ('visu.value == "1"', [5]),
        ("visu.declared - visu.variables == 0", [4, 5]),
        ("count(visu.kind) == 2", [4, 5]),
        ("visu.status == 200", [5]),
    ],
)
def test_a_filter_asks_for_any_message_of_a_frame(words: str, wanted: list[int]) -> None:
    assert chosen(both(), words) == wanted


def test_all_messages_are_written() -> None:
    assert cells(both(), "visu.kind") == {4: "read,write", 5: "reply,reply"}
    assert cells(both(), "visu.value") == {4: "99", 5: "1"}
    assert cells(both(), "visu.status") == {4: "", 5: "200,200"}
    assert cells(both(), "visu.declared") == {4: "1,1", 5: "1,1"}
    assert cells(both(), "visu.index") == {4: "0,0", 5: "0,0"}
    assert cells(both(), "visu.client") == {4: "10.0.0.1", 5: "10.0.0.1"}
    assert cells(both(), "visu.latency") == {4: "", 5: "0.001000000,0.001000000"}


def test_indexes_are_told_where_they_do_not_run_from_0_on() -> None:
    frames = Line().open().ask(post(b"|0|3|5|4|0|2|1| +9|4|2|2|1|5|4|4|2|1|")).answer(answer(b"|1|2|3|")).frames
    assert cells(frames, "visu.index") == {4: "5,9,5", 5: "5,9,5"}
    assert said(frames)[0] == "read 3 variables, indexes 5, 9, 5: 4,0,2,1; 4,2,2,1; 4,4,2,1"
    assert chosen(frames, "visu.index == 9") == [4, 5]
    older = Line().open().ask(b"GET /READPI?ADR7=MW1&FORMAT=%d HTTP/1.1\r\n\r\n").frames
    assert (cells(older, "visu.index"), said(older)) == ({4: ""}, ["read 1 variable: MW1"])


def test_a_status_is_found_behind_others() -> None:
    frames = Line().open().ask(READ + READ).answer(answer(b"|1|") + answer(b"", b"404 Not Found")).frames
    assert chosen(frames, "visu.status == 404") == chosen(frames, 'visu.outcome == "status"') == [5]
    assert cells(frames, "visu.outcome")[5] == "done,status"


def test_json_has_all_kinds() -> None:
    field = next(one for one in VISU_FIELDS if one.name == "visu.kind")
    (told,) = told_of(both())
    packets = told.parts["visu"].row
    assert json_texts(field, FrameRows.of(told, packets)) == ['["read","write"]', '["reply","reply"]']


def test_a_write_behind_many_reads_is_found() -> None:
    frames = Line().open().ask(READ * (MOST_MESSAGES + 9) + WRITE).frames
    assert cells(frames, "visu.messages") == {4: str(MOST_MESSAGES + 10)}
    assert chosen(frames, 'visu.kind == "write"') == chosen(frames, 'visu.value == "99"') == [4]
    assert cells(frames, "visu.kind") == {4: "read,write"}


def test_values_that_may_be_passwords_are_hidden() -> None:
    frames = Line().open().ask(READ + SECRET).frames
    assert cells(frames, "visu.value") == {4: "(hidden)"}
    assert chosen(frames, 'visu.value == "secret"') == []
    assert cells(frames, "visu.value", secrets=True) == {4: "secret"}
