"""The tree of a frame of a page: where its bytes lie, also where a capture ends in front of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.oracle.pcap import write_pcap
from tests.oracle.tcp import ACK, RST
from tests.oracle.tcp_line import CLIENT, SERVER, Line, tcp_frame
from tests.program_here import run_text
from tests.tracker.visu.test_names import START

HEADERS_BYTES = 14 + 20 + 20
OPTIONS = b"\x01" * 40


@pytest.mark.parametrize("captured_options", [0, 1, 39, 40])
def test_no_layer_goes_on_behind_what_was_captured(captured_options: int, tmp_path: Path) -> None:
    body = b"|1|1|0|4|0|4|6|9.5|"
    line = Line(CLIENT, SERVER, now=START).open()
    line.ask(b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))
    sent, heard = line.sent[False], line.sent[True]
    reset = tcp_frame(line.now, SERVER, CLIENT, seq=sent, ack=heard, flags=RST | ACK, options=OPTIONS)
    cut = reset._replace(data=reset.data[: HEADERS_BYTES + captured_options])
    write_pcap([*line.frames, cut], tmp_path / "x.pcap")
    done = run_text("packets", tmp_path / "x.pcap", "-V", "--color", "never")
    assert done.returncode == 0
    tree = done.stdout[done.stdout.index("Frame 5") :]
    titles = [one.strip() for one in tree.splitlines() if one and not one.startswith(" ")]
    (options,) = [one for one in titles if one.startswith("Options")] or [""]
    assert options.split()[1:2] == ([str(captured_options)] if captured_options else [])
    assert titles[-1].startswith("WebVisu")


def test_what_a_server_calls_a_coding_does_not_reach_the_terminal(tmp_path: Path) -> None:
    line = Line().open()
    read = b"POST /webvisu.htm HTTP/1.1\r\nContent-Length: 15\r\n\r\n|0|1|0|4|0|2|1|"
    for request in (read, b"GET /plc_visu.xml HTTP/1.1\r\n\r\n"):
        line.ask(request).answer(b"HTTP/1.1 200 OK\r\nContent-Encoding: \x1b]0;x\x07:q\r\nContent-Length: 3\r\n\r\n|7|")
    write_pcap(line.frames, tmp_path / "x.pcap")
    told = run_text("packets", tmp_path / "x.pcap", "-V", "--color", "never").stdout
    assert "\x1b" not in told
    assert r"reply not read, Content-Encoding \x1b]0;x\x07:q (1.0 ms)" in told
    assert r"variable list, cannot be used: Content-Encoding \x1b]0;x\x07:q" in told
