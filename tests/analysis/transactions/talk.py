"""What pages and panels ask controllers for in tests: a web visualization and a Parameter Manager, in one capture."""

from __future__ import annotations

from tests.oracle.builders import MILLISECOND, SECOND, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line

PANEL, SERVICE, PRESS = "10.0.0.1", "10.0.0.2", "10.0.0.5"
READ, READ_REPLY, WRITE, WRITE_REPLY, NO_ACCESS = 1, 2, 3, 4, 22
NAMES = (
    b'<?xml version="1.0" encoding="ISO-8859-1"?><visu-ini-file><variablelist>'
    b'<variable name="PRG.rSpeed">4,0,4,6</variable><variable name=".CurrentPassword">4,8,41,8</variable>'
    b'<variable name="PRG.sText">4,60,81,8</variable></variablelist></visu-ini-file>'
)
READ_ALL, ESCAPES = "|0|3|0|4|0|4|6|1|4|8|41|8|2|4|60|81|8|", "\x1b[31m\u202ered"
"""A read of all three, and what a controller says that wants to do something to terminals."""


def post(body: str) -> bytes:
    data = body.encode("latin-1", "replace")
    return b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(data), data)


def reply(body: str | bytes, status: str = "200 OK") -> bytes:
    data = body if isinstance(body, bytes) else body.encode("latin-1", "replace")
    return b"HTTP/1.1 %s\r\nContent-Length: %d\r\n\r\n%s" % (status.encode(), len(data), data)


def visu_talk(*, names: bool = True, text: str = "on", panel: str = PANEL) -> list[Frame]:
    """Return what a page says: it reads all, writes a speed, and another one that is refused, and reads in vain."""
    line = Line((panel, 50_000), (PRESS, 80), now=START).open()
    if names:
        line.ask(b"GET /plc/visu_ini.xml HTTP/1.1\r\n\r\n").answer(reply(NAMES))
    line.ask(post(READ_ALL)).answer(reply(f"|21.5|secret|{text}|"))
    line.ask(post("|1|1|0|4|0|4|6|30.25|")).wait(6 * MILLISECOND).answer(reply("|0|"))
    line.ask(post("|1|1|0|4|0|4|6|99|")).answer(reply("|1|"))
    line.ask(post("|0|1|0|4|0|4|6|")).wait(2 * SECOND).answer(reply("|30.25|"))
    line.ask(post("|1|1|0|4|8|41|8|new|")).answer(reply("|0|"))
    line.ask(post("|0|1|0|4|0|4|6|")).close(False).close(True)
    return line.frames


def sdo_talk() -> list[Frame]:
    """Return what a service tool asks: it reads a parameter, writes it twice, and asks in vain for another one."""
    steps = [
        (0, READ, 0x2000, 1, b""), (3, READ_REPLY, 0x2000, 1, b"\x05\x00"), (10, WRITE, 0x2000, 2, b"\x06\x00"),
        (12, WRITE_REPLY, 0x2000, 2, b""), (20, WRITE, 0x2000, 3, b"\x07\x00"), (24, NO_ACCESS, 0x2000, 3, b""),
        (30, READ, 0x2001, 4, b""), (2_500, READ_REPLY, 0x2000, 9, b"\x06\x00"),
    ]  # fmt: skip
    return [
        data_frame(
            START + at_ms * MILLISECOND, *((SERVICE, PRESS) if service in (READ, WRITE) else (PRESS, SERVICE)),
            telegram(service, index, 1, counter=counter, data=data), port=1202, source_port=1202,
        )
        for at_ms, service, index, counter, data in steps
    ]  # fmt: skip


def both(*, panel: str = PANEL) -> list[Frame]:
    """Return both at the same time; the page is on one of these nodes."""
    return sorted([*visu_talk(panel=panel), *sdo_talk()], key=lambda frame: frame.ts_ns)
