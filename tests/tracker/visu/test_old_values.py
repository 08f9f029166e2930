"""What a variable was before it was written, as far as anybody knows that."""

from __future__ import annotations

import pytest

from tests.check.requests import post, reply
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import followed, writes_of

READ, DONE = b"|0|1|0|4|0|2|1|", reply(b"|0|")


def write(value: int) -> bytes:
    return post(b"|1|1|0|4|0|2|1|%d|" % value)


def other() -> Line:
    return Line(("10.0.0.2", 50_000), now=10**8)


def poll() -> Line:
    return Line().open().ask(post(READ)).answer(reply(b"|1|"))


BROKEN_OFF = poll().ask(write(2)).close(True).close(False)
FAILED = poll().ask(write(2)).answer(reply(b"", status=500))
CUT = poll().ask(write(2)[:-9]).lose(True, 9).answer(DONE).ask(post(b"|0|1|0|4|8|2|1|")).answer(reply(b"|1|"))
MISSING = poll().lose(True, len(write(2))).answer(DONE).close(True).close(False)
RESET_BEHIND = poll().lose(True, len(write(2))).lose(False, len(DONE)).reset(True)
UNANSWERED_SO_FAR = poll().ask(write(2))
REFUSED = poll().ask(write(2)).answer(reply(b"|-1|"))
CONFIRMED = poll().ask(write(2)).answer(DONE)
READ_SINCE = poll().ask(write(2)).answer(reply(b"", status=500)).ask(post(READ)).answer(reply(b"|5|"))
OTHER_FAILED = poll().ask(post(b"|1|1|0|4|8|2|1|2|")).answer(reply(b"", status=500))


@pytest.mark.parametrize(
    ("line", "old"),
    [
        (BROKEN_OFF, None), (FAILED, None), (CUT, None), (MISSING, None), (UNANSWERED_SO_FAR, None), (REFUSED, "1"),
        (CONFIRMED, "2"), (READ_SINCE, "5"), (OTHER_FAILED, "1"),
        (RESET_BEHIND, None),
    ],
)  # fmt: skip
@pytest.mark.parametrize("packets", [1, 1000])
def test_it_is_known_where_nothing_else_may_have_been_written(line: Line, old: str | None, packets: int) -> None:
    frames = [*line.frames, *other().open().ask(write(3)).answer(DONE).frames]
    *_, last = writes_of(followed(cut(batch_of(frames), packets)))
    assert last[6:9] == (old, "3", "confirmed")
