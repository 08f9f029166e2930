"""Pairs of which each has a last write that came to something else: as the screen and ``watch --json`` tell it."""

from __future__ import annotations

from pathlib import Path

from nvscope.capture.open import open_sink
from tests.analysis.transactions.talk import post, reply
from tests.oracle.builders import MILLISECOND, START, data_frame, telegram
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import batch_of

_CONTROLLER, _PANEL = "10.0.0.9", 20
_READ, _READ_REPLY, _WRITE, _WRITE_REPLY, _NO_ACCESS, _BUSY = 1, 2, 3, 4, 22, 100
NAMES = '[nodes]\n"10.0.0.9" = { name = "saw" }\n"10.0.0.20" = { name = "panel" }\n'


def make_asking(folder: Path) -> None:
    """Write a capture, and a project that has names for some nodes of it."""
    (folder / "asking.toml").write_text(NAMES)
    with open_sink(str(folder / "asking.pcap")) as sink:
        sink.write(batch_of(sorted([*_parameters(), *_page()], key=lambda frame: frame.ts_ns)))


def _parameters() -> list[Frame]:
    frames = []
    for client, services in (
        (_PANEL, [(_READ, b""), (_READ_REPLY, b"\1"), (_WRITE, b"\2"), (_WRITE_REPLY, b"")]),
        (_PANEL + 1, [(_WRITE, b"\3"), (_NO_ACCESS, b"")]),
        (_PANEL + 2, [(_WRITE, b"\3"), (_BUSY, b"")]),
        (_PANEL + 3, [(_WRITE, b"\3")]),
        (_PANEL + 4, [(_READ, b""), (_READ_REPLY, b"\1")]),
    ):
        at_ns = START + client * MILLISECOND
        for number, (service, data) in enumerate(services):
            ends = (f"10.0.0.{client}", _CONTROLLER)
            told = telegram(service, 0x2000, 0, counter=number // 2, data=data)
            frames.append(
                data_frame(at_ns, *(ends if service in (_READ, _WRITE) else reversed(ends)), told, port=1202)
            )  # fmt: skip
            at_ns += MILLISECOND
    # Until then, somebody has waited too long for a reply; this one has not.
    open_ = telegram(_WRITE, 0x2000, 0, data=b"\4")
    frames.append(data_frame(START + 3_000 * MILLISECOND, "10.0.0.30", _CONTROLLER, open_, port=1202))
    return frames


def _page() -> list[Frame]:
    line = Line(("10.0.0.31", 50_000), ("10.0.0.8", 80), now=START + 500 * MILLISECOND).open()
    line.ask(post("|1|1|0|4|0|4|6|1.5|")).say(False, reply("|0|"), captured=40)
    return line.close(False).close(True).frames
