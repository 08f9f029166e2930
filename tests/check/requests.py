"""Captures with requests, for rules: frames of tests, judged without a file, and as one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.capture.source import SourceInfo
from nvscope.check.deciding import Decided
from nvscope.check.rules import rules_of
from nvscope.check.run import checked
from nvscope.definition.project import Project
from tests.oracle.builders import MILLISECOND, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.oracle.tcp_line import Line
from tests.packets import Batches, batch_of

HMI, SERVICE, PRESS = "10.0.0.1", "10.0.0.3", "10.0.0.2"
READ, READ_REPLY, WRITE, WRITE_REPLY, REFUSED, BUSY = 1, 2, 3, 4, 22, 100
LIST = 12
"""A list that somebody sends, so that there is one."""

Table = Mapping[str, Any]


def decided(
    batches: Iterable[PacketBatch], *rules: Table, warmup_ns: int = 0, drops: int = 0, hears_answers: bool = True,
    project: Project | None = None,
) -> list[Decided]:  # fmt: skip
    """Return the verdicts of rules on batches, which tell of so many frames that were lost."""
    source = Batches(batches)
    source.infos = [SourceInfo("x.pcap", "pcap", drops=drops, hears_answers=hears_answers)]
    tables = [{"id": f"r{number}", **rule} for number, rule in enumerate(rules)]
    found = checked(Inquiry(source, project or Project()), rules_of(tables, "test", warmup_ns))
    return list(found.decided)


def of_frames(frames: Sequence[Frame], *rules: Table, **how: Any) -> list[Decided]:
    """Return the verdicts of rules on frames that come at once."""
    return decided([batch_of(frames)], *rules, **how)


def asked(
    at_ms: float, took_ms: float | None = 3, *, counter: int, service: int = READ, answer: int | None = None,
    index: int = 0x2000, hmi: str = HMI, plc: str = PRESS, data: bytes = b"\1\0", port: int = 1202,
) -> list[Frame]:  # fmt: skip
    """Return a request to the Parameter Manager, and its reply, None for none."""
    begin_ns = round(at_ms * MILLISECOND)
    ends: dict[str, Any] = {"port": port, "source_port": port}
    content = data if service == WRITE else b""
    frames = [data_frame(begin_ns, hmi, plc, telegram(service, index, 1, counter=counter, data=content), **ends)]
    if took_ms is not None:
        kind = answer if answer is not None else {READ: READ_REPLY, WRITE: WRITE_REPLY}[service]
        told = telegram(kind, index, 1, counter=counter, data=data if kind == READ_REPLY else b"")
        frames.append(data_frame(begin_ns + round(took_ms * MILLISECOND), plc, hmi, told, **ends))
    return frames


def sent(at_ms: float, node: str = PRESS) -> Frame:
    """Return a telegram of the list."""
    payload = telegram(list_id=LIST, counter=round(at_ms), data=b"\1\2")
    return data_frame(round(at_ms * MILLISECOND), node, "10.0.0.255", payload)


def in_turn(*frames: Frame | Iterable[Frame]) -> list[Frame]:
    """Return frames in the order of their times."""
    found: list[Frame] = []
    for one in frames:
        found += [one] if isinstance(one, Frame) else list(one)
    return sorted(found, key=lambda frame: frame.ts_ns)


def post(body: bytes) -> bytes:
    """Return the request of a page."""
    return b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % len(body) + body


def reply(body: bytes, status: int = 200) -> bytes:
    """Return a response."""
    return b"HTTP/1.1 %d x\r\nContent-Length: %d\r\n\r\n" % (status, len(body)) + body


VARIABLES = b"""<v><variablelist><variable name=".CurrentPassword">4,481,41,8</variable>
<variable name="PLC_PRG.x">4,144,1,0</variable><variable name="PLC_PRG.y">4,146,2,1</variable></variablelist></v>"""
READ_X = b"|0|1|0|4|144|1|0|"
WRITE_X, WRITE_Y = b"|1|1|0|4|144|1|0|1|", b"|1|1|0|4|146|2|1|77|"
WRITE_PASSWORD = b"|1|1|0|4|481|41|8|sesame|"
DONE, FAILED, VALUE = b"|0|", b"|-1|", b"|1|"


def page(line: Line | None = None) -> Line:
    """Return a connection over which a page has loaded its variable list."""
    line = (line or Line()).open()
    return line.ask(b"GET /plc_visu.xml HTTP/1.1\r\n\r\n").answer(reply(VARIABLES))


def file(frames: Iterable[Frame], path: Path) -> Path:
    """Write frames to a file."""
    write_pcap(frames, path)
    return path
