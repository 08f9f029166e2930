"""HTTP to servers that do as they like: how each exchange ends, and that it does."""

from __future__ import annotations

import gzip
import socket
from collections.abc import Callable

import pytest

from nvscope.errors import CaptureError, UsageError
from nvscope.plc.visu.exchange import Ending
from nvscope.plc.visu.http_request import HttpRequest
from nvscope.plc.visu.link import VisuLink
from nvscope.plc.visu.url import VisuUrl, visu_url
from tests.plc.parameter.peers import LOCAL
from tests.plc.visu.peers import PAGE, Answering, peer, replied, unused_port

BRIEF_NS, PATIENT_NS = 300_000_000, 20_000_000_000
BOMB = b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\n\r\n" + gzip.compress(bytes(50 << 20), 9)


def endless(start: bytes, again: bytes) -> Answering:
    """Say something, and then something again and again, until nobody listens any more."""

    def answering(one: socket.socket, request: HttpRequest, number: int) -> None:
        one.sendall(start)
        while True:
            one.sendall(again)

    return answering


def dripping(text: bytes, at_once: int = 0) -> Answering:
    """Say a part of it, and the rest byte by byte, each after the other side could have given up waiting for one."""

    def answering(one: socket.socket, request: HttpRequest, number: int) -> None:
        one.sendall(text[:at_once])
        one.settimeout(BRIEF_NS / 4e9)
        for place in range(at_once, len(text)):
            try:
                one.recv(1)  # it is here that the other side goes away
                return
            except TimeoutError:
                one.sendall(text[place : place + 1])

    return answering


def resetting(one: socket.socket, request: HttpRequest, number: int) -> None:
    one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")


LONG = b"HTTP/1.1 200 OK\r\nContent-Length: 3000\r\n\r\n" + b"|" * 3000
REPLY = b"HTTP/1.1 200 OK\r\n"


@pytest.mark.parametrize(
    ("answering", "ending", "status"),
    [
        (endless(REPLY, b"X: " + b"a" * 1000 + b"\r\n"), Ending.NO_HTTP, None),
        (endless(REPLY + b"X: ", b"a" * 10_000), Ending.NO_HTTP, None),
        (endless(replied(b""), b"|" * 10_000), Ending.OVERSIZED, 200),
        (BOMB, Ending.OVERSIZED, 200),
        (b"", Ending.BROKEN, None),
        (resetting, Ending.BROKEN, None),
        (LONG[:200], Ending.BROKEN, 200),
        (REPLY + b"Content-Length: 99999999999\r\n\r\nabc", Ending.BROKEN, 200),
        (REPLY + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n", Ending.BROKEN, 200),
        (REPLY + b"Content-Encoding: gzip\r\n\r\nnothing that is packed", Ending.NO_HTTP, 200),
        (b"SSH-2.0-OpenSSH\r\n", Ending.NO_HTTP, None),
        (b"\0\xff" * 100, Ending.NO_HTTP, None),
        (b"HTTP/1.1 abc\r\n\r\n", Ending.NO_HTTP, None),
    ],
)
def test_what_is_no_whole_reply_ends_by_itself(
    answering: Answering | bytes, ending: Ending, status: int | None
) -> None:
    with peer(answering) as one:
        found = VisuLink(visu_url(one.url), timeout_ns=PATIENT_NS).post(PAGE, b"|0|1|0|4|0|1|0|")
    assert (found.ending, found.status, found.body, found.latency_ns) == (ending, status, b"", None), found.why


@pytest.mark.parametrize(
    ("answering", "status"),
    [
        (dripping(LONG), None),
        (dripping(LONG, LONG.index(b"|")), 200),
        (endless(b"", b"HTTP/1.1 100 Continue\r\n\r\n"), None),
    ],
)
def test_who_goes_on_and_on_is_given_up_at_one_time(answering: Answering, status: int | None) -> None:
    with peer(answering) as one:
        found = VisuLink(visu_url(one.url), timeout_ns=BRIEF_NS).post(PAGE, b"|0|1|0|4|0|1|0|")
    assert (found.ending, found.status) == (Ending.SILENT, status)


@pytest.mark.parametrize(
    "answer",
    [
        b"HTTP/1.0 200 OK\n\n|0|",
        REPLY + b"CONTENT-length:3\r\n\r\n|0|and more",
        REPLY + b"transfer-ENCODING: chunked\r\n\r\n2\r\n|0\r\n1;x=y\r\n|\r\n0\r\n\r\n",
        REPLY + b"Content-Encoding: gzip\r\n\r\n" + gzip.compress(b"|0|"),
        b"HTTP/1.1 100 Continue\r\n\r\n" + REPLY + b"\r\n|0|",
    ],
)
def test_odd_replies_are_replies(answer: bytes) -> None:
    with peer(answer) as one:
        found = VisuLink(visu_url(one.url), timeout_ns=PATIENT_NS).post(PAGE, b"|1|1|0|4|0|1|0|1|")
    assert (found.is_good, found.body) == (True, b"|0|")
    assert found.latency_ns is not None


def test_it_asks_as_it_says_in_one_piece_and_goes_nowhere_else(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.setenv(name, f"http://{LOCAL}:{unused_port()}/")
    with peer(b"|1|") as elsewhere:
        answer = f"HTTP/1.1 302 Found\r\nLocation: {elsewhere.url}\r\nContent-Length: 0\r\n\r\n".encode()
        with peer(answer) as one:
            found = VisuLink(visu_url(one.url), timeout_ns=PATIENT_NS).post(PAGE, b"|0|1|0|4|0|1|0|")
        assert (found.status, found.location, found.is_good) == (302, elsewhere.url, False)
        assert one.got == [HttpRequest("POST", PAGE, b"|0|1|0|4|0|1|0|")]
        assert elsewhere.got == []


def test_the_name_is_looked_up_once_and_its_address_is_what_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []
    find: Callable[..., object] = socket.getaddrinfo

    def found(host: str, *words: object, **others: object) -> object:
        looked.append(host)
        return find("192.0.2.1" if host == "far.example" else LOCAL, *words, **others)

    monkeypatch.setattr(socket, "getaddrinfo", found)
    with peer(replied(b"|0|")) as one:
        link = VisuLink(VisuUrl("press.example", one.port, PAGE), timeout_ns=PATIENT_NS)
        assert link.get(PAGE).is_good
        assert link.get(PAGE).is_good
    assert (looked, link.address) == (["press.example"], LOCAL)
    with pytest.raises(UsageError, match=r"192\.0\.2\.1 is neither this machine nor in a private network"):
        VisuLink(VisuUrl("far.example", 80))


@pytest.mark.parametrize("host", ["0.0.0.0", "239.1.1.1", "255.255.255.255", "8.8.8.8"])
def test_nothing_is_sent_to_what_is_no_node_of_the_plant(host: str) -> None:
    with pytest.raises(UsageError):
        VisuLink(VisuUrl(host))


def test_a_name_that_nobody_knows_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object, **__: object) -> object:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with pytest.raises(CaptureError, match="nobody knows this name"):
        VisuLink(VisuUrl("nobody.example"))


def test_nobody_there_is_told() -> None:
    found = VisuLink(VisuUrl(LOCAL, unused_port()), timeout_ns=PATIENT_NS).get(PAGE)
    assert (found.ending, found.status) == (Ending.UNDELIVERED, None)
