"""Rules about writes that nobody saw whole: allowed, or not decided."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.check.verdict import Verdict
from tests.check.requests import HMI, PRESS, SERVICE, WRITE, asked, decided, in_turn, sent
from tests.check.test_writes import FAIL, OPEN, PASS, subjects, writes
from tests.oracle.builders import SECOND, data_frame, telegram
from tests.oracle.frame import Frame
from tests.packets import batch_of, cut


def stray(counter: int, *, index: int = 0x2000, hmi: str = HMI) -> list[Frame]:
    """Return the reply to a write, and not its request."""
    return asked(1000, 3, counter=counter, service=WRITE, index=index, hmi=hmi)[1:]


@pytest.mark.parametrize(
    ("rule", "unseen", "malformed"),
    [
        (writes(only_by=[]), (HMI, OPEN, 0), (HMI, OPEN, 0)),
        (writes(only_by=HMI), (HMI, PASS, 0), (HMI, PASS, 0)),
        (writes(only_to="0x2000:1"), (HMI, PASS, 0), (HMI, PASS, 0)),
        (writes(only_to="0x2001:1"), (HMI, OPEN, 0), (HMI, OPEN, 0)),
        (writes(only_to="sdo/10.0.0.9/*"), (HMI, OPEN, 0), (HMI, OPEN, 0)),
        (writes(only_by=[], partner="10.0.0.9"), (None, PASS, 0), (None, PASS, 0)),
        (writes(only_by=[], requester=SERVICE), (None, PASS, 0), (None, PASS, 0)),
        (writes(only_by=[], protocol="visu"), (None, PASS, 0), (None, PASS, 0)),
        (writes(only_by=[], when="frame.number < 3"), (None, PASS, 0), (None, PASS, 0)),
    ],
)
def test_a_write_that_nobody_saw_whole_is_allowed_or_not_decided(
    rule: dict[str, Any], unseen: tuple[str | None, Verdict, int], malformed: tuple[str | None, Verdict, int]
) -> None:
    assert subjects(in_turn(asked(0, counter=1), stray(2), sent(2000)), rule) == [unseen]
    request = data_frame(SECOND, HMI, PRESS, telegram(WRITE, 0x2000, 1, counter=2, data=b"\1", length=99))
    assert subjects(in_turn(asked(0, counter=1), [request], sent(2000)), rule) == [malformed]
    cut_off = asked(1000, None, counter=2, service=WRITE)[0]
    cut_off = cut_off._replace(data=cut_off.data[:-1])  # its value alone is not captured whole: it is known who wrote
    assert subjects(in_turn(asked(0, counter=1), [cut_off], sent(2000)), writes(only_by=[])) == [(HMI, FAIL, 1)]


@pytest.mark.parametrize("size", [1, 9])
def test_a_reply_that_comes_late_or_again_hides_no_write(size: int) -> None:
    """In front of a request, it is to another one."""
    late = in_turn(asked(0, 700, counter=2, service=WRITE), sent(2000))
    again = in_turn(asked(0, 3, counter=2, service=WRITE), stray(2), sent(2000))
    early = in_turn(stray(2), asked(1500, 3, counter=2, service=WRITE), sent(2000))
    for frames, frame, expected in ((late, 2, PASS), (again, 3, PASS), (early, 1, OPEN)):
        (one,) = decided(cut(batch_of(frames), size), writes(only_by=[], when=f"frame.number == {frame}"))
        assert one.verdict is expected
