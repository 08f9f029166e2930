"""A controller's WebVisu on this machine, asked by plain sockets, by http.client and by curl."""

from __future__ import annotations

import gzip
import http.client
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from nvscope.errors import CaptureError, UsageError
from nvscope.plc.visu.controller import Controller, Handled, Result
from nvscope.plc.visu.server import VisuServer
from nvscope.plc.visu.table import ServedTable
from tests.plc.parameter.peers import LOCAL, WAIT_S, unused_port
from tests.plc.visu.asked_server import KEPT, READ, READ_REPLY, VARIABLES, content, statuses
from tests.plc.visu.peers import PAGE, Served, asked, connected, everything, post, served, table_of


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, VARIABLES) as one:
        yield one


@pytest.mark.parametrize(
    ("body", "reply"),
    [
        (b"|0|1|0|4|0|6|8|", b"|abcde|"),  # the document
        (b"|0|2|0|0|6|1|2|1|2|29|0|0|", b"|3|1|"),
        (b"|0|2|\r\n0|0|6|1|2|\r\n1|2|29|0|0|\r\n", b"|3|1|"),
        (b"|0|2|0|0|6|1|2|1|2|29|0|0", b"|3|1|"),
        (b"|0|2|7|0|6|1|2|7|2|29|0|0|", b"|3|1|"),
        (b"|0|100|0|0|6|1|2|1|2|29|0|0|", b"|3|1|"),  # the document's own example counts wrong
        (b"|0|1|0|4|160|4|6|", b"|3.5|"),
        (b"|0|2|0|4|99|2|1|1|0|6|1|2|", b"|???|3|"),
        (b"|0|2|0|4|18|2|1|1|0|6|1|2|", b"|???|3|"),
        (b"|0|1|0|0|6|2|2|", b"|???|"),
        (b"|0|2|0|0|6|1|2|1|0|6|1|2|", b"|3|3|"),
        (b"|0|1|0|4|22|2|1|", b"|0|0|0|"),
        (b"|0|2|0|0|6|1|2|1|4|24|2|1|", b"|3|"),
        (b"|1|1|0|0|6|1|2|7|", b"|0|"),  # the document
        (b"|1|1|0|0|6|1|2|7", b"|0|"),
        (b"|1|1|0|4|0|6|8|a|b|", b"|0|"),
        (b"|1|1|0|4|0|6|8|abcdef|", b"|1|"),
        (b"|1|1|0|0|6|1|2|256|", b"|1|"),
        (b"|1|1|0|0|6|1|2|x|", b"|1|"),
        (b"|1|1|0|4|10|2|1|5|", b"|1|"),
        (b"|1|1|0|4|99|2|1|5|", b"|1|"),
    ],
)
def test_bodies_are_answered_byte_by_byte(controller: Served, body: bytes, reply: bytes) -> None:
    assert content(asked(controller.port, post(body))) == reply


def test_the_illustrated_request_of_a_browser_is_answered(tmp_path: Path) -> None:
    request = (
        b"POST /PLC/webvisu.htm HTTP/1.1\r\nHost: 192.168.1.3\r\nContent-Type: application/x-www-form-urlencoded\r\n"
        b"Content-Length: 15\r\n\r\n|0|1|0|4|0|6|8|"
    )
    head = 'path = "/PLC/webvisu.htm"\nhttp = "1.0"\ncontent_length = false\n'
    with served(tmp_path, VARIABLES, head) as one:
        reply = asked(one.port, request)
    assert reply.startswith(b"HTTP/1.0 200 OK\r\n")
    assert b"\r\nContent-Type: text/html\r\n" in reply
    assert b"Content-Length" not in reply
    assert reply.endswith(b"\r\n\r\n|abcde|")


def test_what_was_written_is_there_until_the_next_write(controller: Served) -> None:
    for value in (b"7", b"255", b"0"):
        assert content(asked(controller.port, post(b"|1|1|0|0|6|1|2|%s|" % value))) == b"|0|"
        assert content(asked(controller.port, post(READ))) == b"|%s|" % value


def test_several_are_written_all_or_none(controller: Served) -> None:
    both = b"|1|2|0|0|6|1|2|%d|1|%s|5|"
    for place, number, answer, now in ((b"4|10|2|1", 7, b"|1|", b"|3|"), (b"4|12|2|1", 8, b"|0|", b"|8|")):
        assert content(asked(controller.port, post(both % (number, place)))) == answer
        assert content(asked(controller.port, post(READ))) == now


def test_nothing_is_written_by_guess(controller: Served) -> None:
    for body in (b"|1|2|0|0|6|1|2|7|", b"|1|1|0|0|6|1|2|", b"|1|1|0|0|6|1|", b"|1|0|", b"|2|1|0|0|6|1|2|7|"):
        assert statuses(asked(controller.port, post(body))) == [400], body
    assert content(asked(controller.port, post(READ))) == READ_REPLY


def test_files_are_those_of_a_controller(controller: Served) -> None:
    def got(path: str, method: str = "GET") -> bytes:
        return asked(controller.port, f"{method} {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode())

    assert b"<html>" in content(got(PAGE))
    assert b"<html>" in content(got(f"{PAGE}?x=1"))
    own, system = content(got("/plc/plc_visu.xml")), content(got("/plc/visu_ini.xml"))
    assert b'encoding="ISO-8859-1"' in own
    assert b'<variable name="PLC_PRG.rReal">4,160,4,6</variable>' in own
    assert (b".CurrentPassword" in own, b'name=".CurrentPassword">4,100,41,8<' in system) == (False, True)
    assert b"geheim" not in own + system
    assert statuses(got("/plc/none.xml")) == statuses(got("/plc/../etc/passwd")) == statuses(got("/")) == [404]
    assert statuses(asked(controller.port, post(READ, "/other.htm"))) == [404]
    head = got("/plc/plc_visu.xml", "HEAD")
    assert (head.endswith(b"\r\n\r\n"), f"Content-Length: {len(own)}\r\n".encode() in head) == (True, True)
    assert [statuses(got(PAGE, method)) for method in ("PUT", "DELETE", "OPTIONS")] == [[405]] * 3


def test_requests_come_one_behind_the_other_and_are_answered_in_order(tmp_path: Path) -> None:
    """A second request need not wait for the reply to the first: what is late holds up what comes behind it."""
    bodies = [b"|0|1|0|4|12|2|1|", READ, b"|1|1|0|0|6|1|2|9|", READ, b"garbage", READ]
    with served(tmp_path, VARIABLES, KEPT) as one:
        replies = asked(one.port, b"".join(map(post, bodies)))
    assert statuses(replies) == [200, 200, 200, 200, 400, 200]
    bodies_back = [part.partition(b"\r\n\r\n")[2] for part in replies.split(b"HTTP/1.1 ")[1:]]
    assert bodies_back == [b"|0|", b"|3|", b"|0|", b"|9|", b"no request of a WebVisu page\n", b"|9|"]


@pytest.mark.parametrize(
    ("head", "asks_for_the_end", "ends"),
    [
        ("", b"", True),
        (KEPT, b"", False),
        (KEPT, b"Connection: close\r\n", True),
        (f"{KEPT}\nchunked = true\ncontent_length = false", b"", False),
    ],
)
def test_connections_are_kept_where_both_sides_want_that(
    tmp_path: Path, head: str, asks_for_the_end: bytes, ends: bool
) -> None:
    request = b"GET /none HTTP/1.1\r\n" + asks_for_the_end + b"\r\n"
    with served(tmp_path, VARIABLES, head) as one, connected(one.port) as client:
        client.sendall(request)
        reply = client.recv(1 << 16)
        while b"no such file\n" not in reply:
            reply += client.recv(1 << 16)
        assert (b"Connection: close\r\n" in reply) == ends
        if ends:
            assert everything(client) == b""
        else:
            client.sendall(request)
            assert client.recv(1 << 16).startswith(b"HTTP/1.1 404 ")


def test_who_speaks_the_older_version_is_not_left_waiting_for_the_end(tmp_path: Path) -> None:
    with served(tmp_path, VARIABLES, KEPT) as one, connected(one.port) as client:
        client.sendall(b"GET /none HTTP/1.0\r\n\r\n")
        assert everything(client).endswith(b"no such file\n")


def test_a_body_that_waits_to_be_asked_for_is(controller: Served) -> None:
    head, body = post(READ).split(b"\r\n\r\n")
    with connected(controller.port) as client:
        client.sendall(head + b"\r\nExpect: 100-continue\r\n\r\n")
        assert client.recv(100) == b"HTTP/1.1 100 Continue\r\n\r\n"
        client.sendall(body)
        assert content(everything(client)) == READ_REPLY


def test_a_request_may_come_byte_by_byte(controller: Served) -> None:
    with connected(controller.port) as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in post(READ):
            client.sendall(bytes([byte]))
        assert content(everything(client)) == READ_REPLY


KINDS = (
    "", 'http = "1.0"', KEPT, "chunked = true", "gzip = true", "chunked = true\ngzip = true\nkeep_alive = true",
    "content_length = false", "trailing_pipe = false", "bare_lf = true",
)  # fmt: skip


@pytest.mark.parametrize("head", KINDS)
def test_http_client_reads_every_kind_of_reply(tmp_path: Path, head: str) -> None:
    with served(tmp_path, VARIABLES, head) as one:
        connection = http.client.HTTPConnection(LOCAL, one.port, timeout=WAIT_S)
        own = set()
        for body, told in ((READ, b"|3"), (b"|0|1|0|4|0|6|8|", b"|abcde"), (b"|1|1|0|0|6|1|2|3|", b"|0")):
            connection.request("POST", PAGE, body)
            own.add(connection.sock.getsockname())
            reply = connection.getresponse()
            came = reply.read()
            came = gzip.decompress(came) if reply.getheader("Content-Encoding") == "gzip" else came
            # Without the last | no write is confirmed: that is what the table asks for in reads alone.
            closing = b"" if "trailing_pipe" in head and told != b"|0" else b"|"
            assert (reply.status, came) == (200, told + closing)
        connection.close()
    assert len(own) == (1 if "keep_alive" in head else 3)


@pytest.mark.skipif(shutil.which("curl") is None, reason="needs curl")
@pytest.mark.parametrize(
    "head", ["", 'http = "1.0"\ncontent_length = false', "chunked = true\ngzip = true\nkeep_alive = true"]
)
def test_curl_reads_and_writes(tmp_path: Path, head: str) -> None:
    with served(tmp_path, VARIABLES, head) as one:
        listed = subprocess.run(
            ["curl", "-sS", "--compressed", one.url.replace("webvisu.htm", "plc_visu.xml")], capture_output=True,
            timeout=WAIT_S, check=True,
        )  # fmt: skip
        assert b'<variable name="PLC_PRG.nByte">0,6,1,2</variable>' in listed.stdout
        many = "|0|200" + "".join(f"|{number}|0|6|1|2" for number in range(200)) + "|"
        asks = ("|0|1|0|0|6|1|2|", "|1|1|0|0|6|1|2|9|", many)
        words: list[str] = []
        for body in asks:
            words += ["--next"] if words else []
            words += ["-sS", "--compressed", "-H", "Expect: 100-continue", "-d", body, one.url]
        done = subprocess.run(["curl", *words], capture_output=True, timeout=WAIT_S, check=False)
        assert (done.returncode, done.stdout) == (0, b"|3||0|" + b"|9" * 200 + b"|"), done.stderr
        sent = tmp_path / "body"
        sent.write_bytes(b"|0|1|0|4|0|6|8|")
        words = ["-sS", "--compressed", "-H", "Transfer-Encoding: chunked", "--data-binary", f"@{sent}", one.url]
        done = subprocess.run(["curl", *words], capture_output=True, timeout=WAIT_S, check=False)
        assert done.stdout == b"|abcde|", done.stderr
        done = subprocess.run(
            ["curl", "-sSI", "--http1.0", one.url], capture_output=True, timeout=WAIT_S, check=False
        )  # fmt: skip
        assert b"200 OK" in done.stdout, done.stderr


def test_what_is_to_go_wrong_does(controller: Served) -> None:
    assert asked(controller.port, post(b"|0|2|0|0|6|1|2|1|4|16|2|1|")) == b""
    assert statuses(asked(controller.port, post(b"|0|2|0|0|6|1|2|1|4|20|2|1|"))) == [503]
    with connected(controller.port) as client:
        client.sendall(post(b"|0|1|0|4|14|2|1|"))
        client.settimeout(0.2)
        with pytest.raises(TimeoutError):
            client.recv(1)
        assert content(asked(controller.port, post(READ))) == READ_REPLY
    results = [one.result for one in controller.controller.handled]
    assert results == [Result.DROPPED, Result.REFUSED, Result.SILENT, Result.ANSWERED]


def test_a_late_answer_holds_up_nobody_else(controller: Served) -> None:
    with connected(controller.port) as late, connected(controller.port) as other:
        late.sendall(post(b"|0|1|0|4|12|2|1|"))
        while not controller.posted:
            time.sleep(0.001)
        other.sendall(post(READ))
        assert content(everything(other)) == READ_REPLY
        late.setblocking(False)
        with pytest.raises(BlockingIOError):
            late.recv(1)
        late.settimeout(WAIT_S)
        assert content(everything(late)) == b"|0|"


def test_it_ends_after_so_many_requests_and_answers_them_all(tmp_path: Path) -> None:
    with VisuServer(Controller(table_of(tmp_path, VARIABLES)), LOCAL, 0) as server, ExitStack() as clients:
        both = [clients.enter_context(connected(server.port)) for _ in range(2)]
        both[0].sendall(post(b"|0|1|0|4|12|2|1|"))
        both[1].sendall(post(READ))
        told: list[tuple[Handled, str, int]] = []
        server.run(lambda *one: told.append(one), lambda: False, count=2)
        assert {(address, port) for _, address, port in told} == {(LOCAL, one.getsockname()[1]) for one in both}
        assert [content(everything(one)) for one in both] == [b"|0|", b"|3|"]


def test_it_ends_after_a_time_with_connections_open(tmp_path: Path) -> None:
    with VisuServer(Controller(table_of(tmp_path, VARIABLES)), LOCAL, 0) as server, connected(server.port) as idle:
        begun_s = time.monotonic()
        server.run(lambda *_: None, lambda: False, lasts_ns=1)
        assert everything(idle) == b""
        assert time.monotonic() - begun_s < WAIT_S / 2


def test_it_ends_while_answers_wait(tmp_path: Path) -> None:
    late = '"late" = { address = "4,0,2,1", delay = "30s" }'
    with ExitStack() as clients:
        with served(tmp_path, late) as one:
            waiting = clients.enter_context(connected(one.port))
            waiting.sendall(post(b"|0|1|0|4|0|2|1|"))
            while not one.posted:
                time.sleep(0.001)
        assert everything(waiting) == b""


@pytest.mark.skipif(sys.platform != "linux" or not Path("/proc/net/if_inet6").exists(), reason="no IPv6")
def test_it_answers_over_ipv6(tmp_path: Path) -> None:
    controller = Controller(table_of(tmp_path, VARIABLES))
    with VisuServer(controller, "::1", 0) as server, socket.create_connection(("::1", server.port), WAIT_S) as client:
        client.sendall(post(READ))
        told: list[str] = []
        server.run(lambda _, address, port: told.append(address), lambda: False, count=1)
        assert (told, content(everything(client))) == (["::1"], READ_REPLY)


def test_a_port_that_somebody_has_is_told(controller: Served) -> None:
    with pytest.raises(CaptureError, match="cannot be answered at"):
        VisuServer(Controller(ServedTable(())), LOCAL, controller.port)


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.0.2.1", "8.8.8.8"])
def test_nobody_else_is_answered_unless_that_is_allowed(address: str) -> None:
    with pytest.raises(UsageError, match="unless that is allowed") as raised:
        VisuServer(Controller(ServedTable(())), address, unused_port())
    assert "--allow-network" in raised.value.next_step
