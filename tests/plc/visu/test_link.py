"""Requests over HTTP to servers that answer, that answer oddly, and that mean harm: all of it ends, and is told."""

from __future__ import annotations

import gzip
import itertools
import socket
import sys
import time
import tracemalloc
import zlib
from collections.abc import Callable
from contextlib import suppress

import pytest

from nvscope.errors import CaptureError, UsageError
from nvscope.plc.visu.exchange import Ending, Exchange
from nvscope.plc.visu.http_request import HttpRequest
from nvscope.plc.visu.link import VisuLink
from nvscope.plc.visu.url import visu_url
from tests.plc.parameter.peers import LOCAL, WAIT_S
from tests.plc.visu.peers import PAGE, Answering, peer, replied, unused_port

MS = 1_000_000
PATIENT_NS, BRIEF_NS = 20_000 * MS, 300 * MS
"""For what ends by an answer, and for what ends without one."""

BODY = b"|0|1|0|4|0|6|8|"
OK = b"HTTP/1.1 200 OK\r\n"


def link_to(url: str, timeout_ns: int = PATIENT_NS) -> VisuLink:
    return VisuLink(visu_url(url), timeout_ns=timeout_ns)


def answered(answering: Answering | bytes, timeout_ns: int = PATIENT_NS) -> Exchange:
    """Return what comes of a request to a server that answers so."""
    with peer(answering) as one:
        return link_to(one.url, timeout_ns).post(PAGE, BODY)


def zipped(content: bytes) -> bytes:
    return gzip.compress(content, mtime=0)


def chunks(*parts: bytes) -> bytes:
    return b"".join(b"%x\r\n%s\r\n" % (len(part), part) for part in [*parts, b""])


def test_what_is_sent_is_a_whole_request_in_one_piece() -> None:
    """Small servers may look at no more than what comes first."""
    first: list[bytes] = []

    with socket.create_server((LOCAL, 0)) as server:
        server.settimeout(WAIT_S)
        port = server.getsockname()[1]
        link = link_to(f"http://{LOCAL}:{port}{PAGE}", 200 * MS)
        found = link.post(PAGE, BODY)
        one, _ = server.accept()
        with one:
            first.append(one.recv(1 << 16))
    head, _, body = first[0].partition(b"\r\n\r\n")
    line, *headers = head.decode("ascii").split("\r\n")
    assert (found.ending, line, body) == (Ending.SILENT, f"POST {PAGE} HTTP/1.1", BODY)
    told = {name.lower(): value for name, _, value in (one.partition(": ") for one in headers)}
    assert (told["host"], told["content-length"], told["connection"]) == (f"{LOCAL}:{port}", str(len(BODY)), "close")
    assert told["content-type"] == "application/x-www-form-urlencoded"


@pytest.mark.parametrize(
    "reply",
    [
        replied(b"|7|"),
        b"HTTP/1.0 200 OK\r\nServer: WAGO_Webs\r\nPragma: no-cache\r\nContent-type: text/html\r\n\r\n|7|",
        OK + b"Content-Length: 3\r\n\r\n|7|",
        OK + b"CONTENT-LENGTH:3\r\n\r\n|7|",
        OK + b"content-length: 3\r\nConnection: keep-alive\r\n\r\n|7|",
        b"HTTP/1.1 200 OK\nContent-Length: 3\n\n|7|",
        b"HTTP/1.1 200\r\n\r\n|7|",
        OK + b"Content-Type: image/png\r\nContent-Length: 3\r\n\r\n|7|",
        OK + b"Transfer-Encoding: chunked\r\n\r\n" + chunks(b"|", b"7|"),
        OK + b"transfer-encoding: Chunked\r\n\r\n2;x=y\r\n|7\r\n1\r\n|\r\n0\r\nTrailer: z\r\n\r\n",
        OK + b"Content-Encoding: gzip\r\n\r\n" + zipped(b"|7|"),
        OK + b"Content-Encoding: deflate\r\n\r\n" + zlib.compress(b"|7|"),
        OK + b"Content-Encoding: gzip\r\nTransfer-Encoding: chunked\r\n\r\n" + chunks(zipped(b"|7|")),
        OK + b"Content-Length:3\r\n\r\n|7|and more",
        b"HTTP/1.1 100 Continue\r\n\r\n" + OK + b"Content-Length: 3\r\n\r\n|7|",
    ],
)
def test_replies_of_every_kind_are_read(reply: bytes) -> None:
    whole = answered(reply)
    assert (whole.ending, whole.status, whole.body) == (Ending.REPLIED, 200, b"|7|"), whole.why
    assert whole.latency_ns is not None

    def one_by_one(connection: socket.socket, *_: object) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for number in range(len(reply)):
            connection.sendall(reply[number : number + 1])

    assert answered(one_by_one).body == b"|7|"


def test_each_request_is_a_connection_of_its_own() -> None:
    with peer(replied(b"|7|")) as one:
        link = link_to(one.url)
        assert [link.post(PAGE, BODY).body, link.get("/x.xml").body] == [b"|7|"] * 2
    assert one.got == [HttpRequest("POST", PAGE, BODY, closes=True), HttpRequest("GET", "/x.xml", closes=True)]


def flood(head: bytes, piece: bytes) -> Answering:
    def answering(connection: socket.socket, *_: object) -> None:
        connection.sendall(head)
        for _ in range(5_000):
            connection.sendall(piece)

    return answering


def drip(head: bytes, piece: bytes) -> Answering:
    def answering(connection: socket.socket, *_: object) -> None:
        connection.sendall(head)
        while True:
            connection.sendall(piece)
            time.sleep(0.01)

    return answering


@pytest.mark.parametrize(
    ("reply", "ending"),
    [
        (b"", Ending.BROKEN),
        (b"\r\n", Ending.NO_HTTP),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", Ending.NO_HTTP),
        (b"SSH-2.0-OpenSSH_9.2\r\n", Ending.NO_HTTP),
        (b"|7|", Ending.NO_HTTP),
        (b"HTTP/1.1 abc\r\n\r\n|7|", Ending.NO_HTTP),
        (b"HTTP/1.1 99999 x\r\n\r\n|7|", Ending.NO_HTTP),
        (OK + b"Content-Encoding: gzip\r\n\r\n" + zipped(bytes(10_000_000)), Ending.OVERSIZED),
        (OK + b"Content-Encoding: deflate\r\n\r\n" + zlib.compress(bytes(10_000_000)), Ending.OVERSIZED),
        (OK + b"Content-Encoding: br\r\n\r\n|7|", Ending.NO_HTTP),
        (b"HTT", Ending.BROKEN),
        (b"HTTP/1.1 2", Ending.BROKEN),
        (OK + b"X", Ending.BROKEN),
        (OK + b"X: y\r\n", Ending.BROKEN),
        (b"ICY 200 OK\r\n\r\n|7|", Ending.NO_HTTP),
        (OK, Ending.BROKEN),
        (OK + b"Content-Length: 9\r\n\r\n|7|", Ending.BROKEN),
        (OK + b"Transfer-Encoding: chunked\r\n\r\n2\r\n|7\r\n", Ending.BROKEN),
        (OK + b"Transfer-Encoding: chunked\r\n\r\n9\r\n|7\r\n", Ending.BROKEN),
        (OK + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n|7|\r\n0\r\n\r\n", Ending.NO_HTTP),
        (OK + b"Transfer-Encoding: chunked\r\n\r\n-3\r\n|7|\r\n0\r\n\r\n", Ending.NO_HTTP),
        (OK + b"Content-Encoding: gzip\r\n\r\n|7|", Ending.NO_HTTP),
        (OK + b"Content-Encoding: gzip\r\n\r\n" + zipped(b"|7|" * 99)[:-9], Ending.NO_HTTP),
        (OK + b"Content-Length: 3, 4\r\n\r\n|7|", Ending.NO_HTTP),
        (OK + b"X: y\r\n" * 1_000 + b"\r\n|7|", Ending.OVERSIZED),
        (OK + b"X: " + b"y" * 100_000 + b"\r\n\r\n|7|", Ending.OVERSIZED),
        (b"HTTP/1.1 200 " + b"y" * 100_000 + b"\r\n\r\n|7|", Ending.NO_HTTP),
    ],
)
def test_what_is_no_whole_reply_is_told(reply: bytes, ending: Ending) -> None:
    found = answered(reply)
    assert (found.ending, found.body, found.latency_ns) == (ending, b"", None), found.why
    assert found.why
    assert "(b'" not in found.why
    assert "Read(" not in found.why


@pytest.mark.parametrize(
    ("answering", "ending"),
    [
        (flood(OK, b"X: y\r\n" * 1_000), Ending.OVERSIZED),
        (flood(b"", b"y" * 10_000), Ending.NO_HTTP),
        (flood(OK + b"\r\n", b"|7" * 5_000), Ending.OVERSIZED),
        (flood(OK + b"Content-Length: 99999999999999\r\n\r\n", b"|7" * 5_000), Ending.OVERSIZED),
        (flood(OK + b"Transfer-Encoding: chunked\r\n\r\n", chunks(b"|7" * 5_000)[:-5]), Ending.OVERSIZED),
        (flood(OK + b"Transfer-Encoding: chunked\r\n\r\n-1\r\n", b"|7" * 5_000), Ending.OVERSIZED),
        (flood(OK + b"Transfer-Encoding: chunked\r\n\r\n", b"1;" + b"x" * 10_000 + b"\r\n|\r\n"), Ending.OVERSIZED),
        (flood(OK + b"Content-Encoding: gzip\r\n\r\n", zipped(bytes(10_000_000))), Ending.OVERSIZED),
    ],
)
def test_what_never_ends_is_not_read_to_its_end(answering: Answering, ending: Ending) -> None:
    tracemalloc.start()
    try:
        found = answered(answering)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (found.ending, found.body) == (ending, b""), found.why
    assert most < 30_000_000


@pytest.mark.parametrize(
    "answering",
    [
        drip(b"", b"H"),
        drip(OK, b"X"),
        drip(OK + b"\r\n", b"|7"),
        drip(OK + b"Content-Length: 9999\r\n\r\n", b"|7"),
        drip(OK + b"Transfer-Encoding: chunked\r\n\r\n", b"1\r\n|\r\n"),
        drip(b"", b"HTTP/1.1 100 Continue\r\n\r\n"),
        drip(OK + b"Content-Encoding: gzip\r\n\r\n" + zipped(b"|7|")[:10], b"\0"),
    ],
)
def test_what_drips_ends_at_the_timeout(answering: Answering) -> None:
    begun_s = time.monotonic()
    found = answered(answering, BRIEF_NS)
    assert (found.ending, found.body) == (Ending.SILENT, b""), found.why
    assert time.monotonic() - begun_s < WAIT_S / 2  # each byte is no new timeout


@pytest.mark.parametrize("status", [301, 302, 307, 308])
def test_nobody_is_followed_elsewhere(status: int) -> None:
    with peer(replied(b"|7|")) as elsewhere:
        moved = f"HTTP/1.1 {status} Moved\r\nLocation: {elsewhere.url}\r\nContent-Length: 0\r\n\r\n"
        found = answered(moved.encode())
    assert (found.status, found.location, elsewhere.got) == (status, elsewhere.url, [])


def test_where_it_leads_to_may_be_anything_and_is_cut() -> None:
    found = answered(b"HTTP/1.1 302 x\r\nLocation: \x1b[31m" + b"x" * 10_000 + b"\r\nContent-Length: 0\r\n\r\n")
    assert (found.status, len(found.location)) == (302, 300)


def test_a_connection_that_is_reset_is_told() -> None:
    def answering(connection: socket.socket, *_: object) -> None:
        connection.sendall(OK + b"Content-Length: 9\r\n\r\n|7")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")

    assert answered(answering).ending is Ending.BROKEN


def test_no_proxy_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    with peer(replied(b"|8|")) as proxy:
        for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
            monkeypatch.setenv(name, f"http://{LOCAL}:{proxy.port}")
        assert answered(replied(b"|7|")).body == b"|7|"
    assert proxy.got == []


def test_nobody_there_is_told() -> None:
    found = link_to(f"http://{LOCAL}:{unused_port()}{PAGE}").post(PAGE, BODY)
    assert (found.ending, found.status, found.why) == (Ending.UNDELIVERED, None, "Connection refused")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems take more connections than they say")
def test_whoever_takes_no_connections_is_waited_for_no_longer_than_that() -> None:
    with socket.socket() as full:
        full.bind((LOCAL, 0))
        full.listen(0)
        waiting = []
        with suppress(TimeoutError):
            for _ in range(10):
                waiting.append(socket.create_connection(full.getsockname(), 0.1))
        found = link_to(f"http://{LOCAL}:{full.getsockname()[1]}{PAGE}", BRIEF_NS).post(PAGE, BODY)
        for one in waiting:
            one.close()
    assert (found.ending, found.why) == (Ending.SILENT, "timed out")


@pytest.mark.parametrize(
    ("url", "told"),
    [
        ("8.8.8.8", "8.8.8.8 is neither this machine nor in a private network"),
        ("172.32.0.1", "172.32.0.1 is neither"),
        ("100.64.0.1", "100.64.0.1 is neither"),
        ("[2001:db8::1]", "2001:db8::1 is neither"),
        ("[::ffff:8.8.8.8]", "8.8.8.8 is neither"),
        ("0x08080808", "8.8.8.8 is neither"),
        ("239.1.1.1", "239.1.1.1 is no node"),
        ("0.0.0.0", "0.0.0.0 is no node"),
        ("[::]", ":: is no node"),
        ("255.255.255.255", "255.255.255.255 is no node"),
    ],
)
def test_nobody_is_asked_who_may_not_be(url: str, told: str) -> None:
    with pytest.raises(UsageError) as raised:
        VisuLink(visu_url(url))
    assert told in raised.value.what


@pytest.mark.parametrize("url", ["127.0.0.1", "10.0.0.1", "172.31.255.255", "192.168.1.3", "169.254.1.1", "[::1]"])
def test_who_is_near_may_be_asked(url: str) -> None:
    assert VisuLink(visu_url(url)).address == url.strip("[]")


def test_somebody_far_may_be_asked_where_that_is_allowed() -> None:
    assert VisuLink(visu_url("192.0.2.1"), allow_network=True).address == "192.0.2.1"
    with pytest.raises(UsageError, match="is no node"):
        VisuLink(visu_url("239.1.1.1"), allow_network=True)


def test_all_addresses_of_a_name_must_be_near(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which of them is connected to, the system says."""
    found = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (one, 80)) for one in ("192.168.1.3", "192.0.2.1")]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
    with pytest.raises(UsageError, match=r"192\.0\.2\.1 is neither"):
        VisuLink(visu_url("plc.example"))


@pytest.mark.parametrize("name", ["no-such-name.invalid", f"{'a' * 64}.invalid", "a..b"])
def test_a_name_that_nobody_knows_is_told(name: str) -> None:
    with pytest.raises(CaptureError, match="nobody knows this name"):
        VisuLink(visu_url(f"http://{name}/plc/webvisu.htm"))


def test_a_name_is_looked_up_once_and_its_address_is_what_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []
    find: Callable[..., object] = socket.getaddrinfo

    def found(host: str, *words: object, **others: object) -> object:
        looked.append(host)
        return find(LOCAL, *words, **others)

    monkeypatch.setattr(socket, "getaddrinfo", found)
    with peer(replied(b"|7|")) as one:
        link = VisuLink(visu_url(f"press.example:{one.port}"), timeout_ns=PATIENT_NS)
        assert [link.get(PAGE).body for _ in range(2)] == [b"|7|"] * 2
    assert (looked, link.address) == (["press.example"], LOCAL)


def test_the_next_address_of_a_name_is_tried_where_nobody_is_at_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    with peer(replied(b"|7|")) as one:
        ports = unused_port(), one.port
        found = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (LOCAL, port)) for port in ports]
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
        link = VisuLink(visu_url(f"plc:{one.port}"), timeout_ns=PATIENT_NS)
        monkeypatch.undo()
        assert [link.post(PAGE, BODY).body for _ in range(2)] == [b"|7|"] * 2


def test_a_reply_may_come_in_pieces_of_any_size() -> None:
    reply = OK + b"Transfer-Encoding: chunked\r\n\r\n" + chunks(*itertools.repeat(b"|1234567", 2_000))
    found = answered(reply)
    assert (found.ending, found.body) == (Ending.REPLIED, b"|1234567" * 2_000)
