"""What else is spoken over the ports of WebVisu: named, and not decoded."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nvscope.protocols.visu import VISU
from nvscope.tracker.summary import summarize
from nvscope.tracker.visu.on_demand import OTHERS
from nvscope.view.documents.visu import visu_other_rows, visu_rows
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.packets import batch_of, cut
from tests.tracker.visu.followed import followed

OK = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n\x00\x01"
V3 = b"POST /WebVisuV3.bin HTTP/1.1\r\nContent-Length: 4\r\n\r\n|0|1"
SOAP = b"POST /TcAdsWebService/TcAdsWebService.dll HTTP/1.1\r\nContent-Length: 3\r\n\r\n<x>"
PAGE = b"GET /webvisu.htm HTTP/1.1\r\n\r\n"
READ = b"POST /WebVisuV3.bin HTTP/1.1\r\nContent-Length: 17\r\n\r\n|0|1|0|4|144|1|0|"
HELLO = b"\x16\x03\x01\x00\x05hello"
RECORD = b"\x17\x03\x03\x00\x02ab"
MODBUS = bytes(range(12)) * 2 + b"\n" + bytes(3000)


def spoken(frames: Sequence[Frame], packets: int) -> list[tuple[str, int, str, int, int]]:
    """Return client, port, protocol, how often and in which frame first, of frames in batches of some packets."""
    found = summarize(followed(cut(batch_of(frames), packets))).others
    assert not visu_rows(found.get(VISU.name, ()))
    return [
        (row["client"], row["port"], row["protocol"], row["count"], row["first_frame"])
        for row in visu_other_rows(found.get(OTHERS, ()))
    ]  # fmt: skip


@pytest.mark.parametrize("packets", [1, 2, 1000])
class TestBeside:
    def test_requests_are_known_by_where_they_are_posted(self, packets: int) -> None:
        line = Line().open()
        for request in (V3, V3, PAGE, SOAP):
            line.ask(request).answer(OK)
        assert spoken(line.frames, packets) == [
            ("10.0.0.1", 80, "webvisu-v3", 2, 4), ("10.0.0.1", 80, "twincat", 1, 10),
        ]  # fmt: skip

    def test_a_connection_is_known_by_how_it_begins(self, packets: int) -> None:
        line = Line().open().ask(HELLO[:1]).ask(HELLO[1:] + bytes(4000)).answer(RECORD).ask(RECORD * 300)
        assert spoken(line.frames, packets) == [("10.0.0.1", 80, "tls", 1, 5)]

    def test_what_nobody_knows_is_no_http(self, packets: int) -> None:
        line = Line(server=("10.0.0.5", 8080)).open().ask(MODBUS).answer(MODBUS).ask(MODBUS)
        assert spoken(line.frames, packets) == [("10.0.0.1", 8080, "other", 1, 4)]

    def test_of_http_1_nothing_is_told_where_it_is_not_read_either(self, packets: int) -> None:
        asks = (
            b"PROPFIND /dav HTTP/1.1\r\n\r\n", b"SUBSCRIBE /upnp HTTP/1.1\r\n\r\n", b"GET /old\r\n",
            b"GET /a?name=two words HTTP/1.1\r\n\r\n", b"GET /" + bytes(3000), b"OPTIONS HTTP/1.1\n\n",
            b"POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
            b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nnone\r\n",
        )  # fmt: skip
        lines = [Line(("10.0.0.1", port)).open().ask(ask[:2]).ask(ask[2:]) for port, ask in enumerate(asks, 50_000)]
        assert spoken([frame for line in lines for frame in line.frames], packets) == []

    def test_http_2_is_known_by_its_preface(self, packets: int) -> None:
        line = Line().open().ask(b"PRI * HTTP/2.0\r\n").ask(b"\r\nSM\r\n\r\n" + bytes(9))
        assert spoken(line.frames, packets) == [("10.0.0.1", 80, "http2", 1, 4)]

    def test_behind_a_hole_or_a_request_nobody_says_so(self, packets: int) -> None:
        line = Line().open().lose(True, 10).ask(MODBUS).answer(b"").segment(False, ack=9_000_000)
        other = Line(("10.0.0.2", 50_000)).open().ask(PAGE).answer(OK).ask(MODBUS)
        begun = Line(("10.0.0.3", 50_000)).ask(MODBUS)
        assert spoken([*line.frames, *other.frames, *begun.frames], packets) == []


def test_a_request_of_a_page_is_one_wherever_it_is_posted() -> None:
    line = Line().open().ask(READ).answer(b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n|7|")
    found = summarize(followed([batch_of(line.frames)])).others
    assert OTHERS not in found
    (row,) = visu_rows(found[VISU.name])
    assert (row["reads"], row["replies"]) == (1, 1)


FORM = b"POST /login HTTP/1.1\r\nContent-Length: 9\r\n\r\n"
ASKS = b"POST /plc/webvisu.htm HTTP/1.1\r\nContent-Length: 17\r\n\r\n"


@pytest.mark.parametrize("packets", [1, 1000])
class TestOfWhichTheBodyIsMissing:
    def test_posts_to_other_sites_are_none_of_pages(self, packets: int) -> None:
        line = Line().open()
        for _ in range(3):
            line.ask(FORM).lose(True, 9).answer(OK)
        line.ask(FORM[:9]).lose(True, len(FORM)).answer(OK)
        assert spoken(line.frames, packets) == []

    def test_posts_to_the_page_are_and_those_behind_others(self, packets: int) -> None:
        page = Line().open().ask(ASKS).lose(True, 17).answer(OK).close(True).close(False)
        behind = Line(("10.0.0.2", 50_000)).open().ask(READ).answer(OK).ask(FORM[:9]).lose(True, 60).answer(OK)
        behind.close(True).close(False)
        found = summarize(followed(cut(batch_of([*page.frames, *behind.frames]), packets))).others
        assert [(row["client"], row["reads"], row["cut"]) for row in visu_rows(found[VISU.name])] == [
            ("10.0.0.1", 0, 1), ("10.0.0.2", 1, 1),
        ]  # fmt: skip
