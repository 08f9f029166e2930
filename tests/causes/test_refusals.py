"""What a web server refuses: the statuses are named, next steps fit them, and what is refused alike is one cause."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.open import open_sink
from nvscope.causes.cause import Cause
from nvscope.findings import visu_refusals as refusals
from tests.analysis.transactions.talk import post
from tests.causes.told import causes_of
from tests.oracle.builders import MILLISECOND
from tests.oracle.tcp_line import Line
from tests.packets import batch_of

PAGE, PLC = "10.0.0.20", "10.0.0.10"
READ = b"|0|1|0|4|0|4|6|"


def told(replies: list[tuple[bytes, int, bytes]], folder: Path) -> list[Cause]:
    """Return the causes where requests got some replies: body of the request, status and body of the reply."""
    line = Line((PAGE, 50_000), (PLC, 8080)).open()
    for asked, status, body in replies:
        head = f"HTTP/1.1 {status} So\r\nContent-Length: {len(body)}\r\n\r\n"
        line.wait(1000 * MILLISECOND).ask(post(asked.decode())).answer(head.encode() + body)
    sink = open_sink(str(folder / "x.pcap"))
    sink.write(batch_of(line.frames))
    sink.close()
    return list(causes_of(Inquiry([str(folder / "x.pcap")]))[1])


def write(offset: int) -> bytes:
    return b"|1|1|0|4|%d|4|6|1.25|" % offset


@pytest.mark.parametrize(
    ("status", "step"),
    [
        (404, refusals.NEXT_OF_THE_PATH), (401, refusals.NEXT_OF_THE_LOGIN), (302, refusals.NEXT_OF_THE_WAY),
        (503, refusals.NEXT_OF_THE_SERVER),
    ],
)  # fmt: skip
def test_the_status_of_reads_is_named_with_a_step_that_fits(status: int, step: str, tmp_path: Path) -> None:
    (cause,) = told([(READ, status, b"x")] * 10, tmp_path)
    assert cause.title == f"{PLC} answered 10 reads of {PAGE} with HTTP status {status}"
    assert cause.next == step


def test_several_statuses_are_told_with_how_often_each_came(tmp_path: Path) -> None:
    (cause,) = told([(READ, status, b"x") for status in (503, 404, 500, 503)], tmp_path)
    assert cause.title.endswith("with HTTP status 503 (2), 404 (1), 500 (1)")
    assert cause.next == refusals.NEXT_OF_THE_SERVER


def test_writes_that_are_refused_alike_are_one_cause(tmp_path: Path) -> None:
    (cause,) = told([(write(4 * number), 200, b"|1|") for number in range(9)], tmp_path)
    assert cause.title == f"{PLC} refused 9 writes of 4,0,4,6; 4,4,4,6; 4,8,4,6 and 6 more by {PAGE}"
    assert cause.next == refusals.NEXT_OF_THE_LIST
    assert (len(cause.findings), cause.count) == (9, 9)


def test_writes_that_are_refused_otherwise_are_another_cause(tmp_path: Path) -> None:
    statuses = (404, 500, 404, 500, 200)
    causes = told([(write(4 * number), status, b"|1|") for number, status in enumerate(statuses)], tmp_path)
    assert {cause.title: cause.next for cause in causes} == {
        f"{PLC} refused 2 writes of 4,0,4,6; 4,8,4,6 by {PAGE}: HTTP status 404": refusals.NEXT_OF_THE_PATH,
        f"{PLC} refused 2 writes of 4,4,4,6; 4,12,4,6 by {PAGE}: HTTP status 500": refusals.NEXT_OF_THE_SERVER,
        f"{PLC} refused 1 write of 4,16,4,6 by {PAGE}": refusals.NEXT_OF_THE_LIST,
    }
