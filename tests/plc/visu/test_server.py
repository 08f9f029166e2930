"""A served WebVisu on its port: asked by plain sockets, by Python's client and by curl."""

from __future__ import annotations

import http.client
import shutil
import socket
import subprocess
import threading
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from nvscope.errors import CaptureError, UsageError
from nvscope.plc.visu.controller import Controller, Handled, Result
from nvscope.plc.visu.server import FULL, MOST_CONNECTIONS, SLOW, VisuServer
from nvscope.plc.visu.table import ServedTable
from tests.laws import examples
from tests.plc.parameter.peers import LOCAL, WAIT_S
from tests.plc.visu.peers import PAGE, asked, connected, everything, post, served, table_of, unused_port

TABLE = """
"a" = { address = "4,0,2,1", value = 7 }
"late" = { address = "4,2,2,1", delay = "30s" }
"soon" = { address = "4,4,2,1", delay = "20ms" }
"drop" = { address = "4,6,2,1", drop = true }
"silent" = { address = "4,8,2,1", silent = true }
"""
READ = b"|0|1|0|4|0|2|1|"


def read_of(offset: int) -> bytes:
    return post(f"|0|1|0|4|{offset}|2|1|".encode())


def test_it_answers_plain_sockets(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one:
        assert asked(one.port, post(READ)).endswith(b"\r\n\r\n|7|")
        assert asked(one.port, b"POST /plc/webvisu.htm HTTP/1.0\n\n" + READ).endswith(b"|7|")
        assert asked(one.port, b"hello\r\n").startswith(b"HTTP/1.1 400 ")
        assert asked(one.port, read_of(6)) == b""
        assert asked(one.port, b"") == b""


def test_a_request_in_pieces_is_one(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one, connected(one.port) as asking:
        for byte in post(READ):
            asking.sendall(bytes([byte]))
        assert everything(asking).endswith(b"|7|")


@pytest.mark.parametrize("head", ["keep_alive = true", "keep_alive = true\nchunked = true\ngzip = true"])
def test_a_connection_is_kept(tmp_path: Path, head: str) -> None:
    with served(tmp_path, TABLE, head) as one:
        asking = http.client.HTTPConnection(LOCAL, one.port, timeout=WAIT_S)
        own = set()
        for _ in range(3):
            asking.request("POST", PAGE, READ)
            own.add(asking.sock.getsockname())
            reply = asking.getresponse()
            assert (reply.status, bool(reply.read())) == (200, True)
        assert len(own) == 1
        asking.close()
        with connected(one.port) as together:
            together.sendall(post(READ) * 3)
            together.shutdown(socket.SHUT_WR)
            assert everything(together).count(b"HTTP/1.1 200 OK") == 3


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
@pytest.mark.parametrize("head", ["", 'http = "1.0"\ncontent_length = false', "chunked = true", "gzip = true"])
def test_curl_understands_it(tmp_path: Path, head: str) -> None:
    with served(tmp_path, TABLE, head) as one:
        words = ["curl", "-sS", "--noproxy", "*", "--compressed", "--max-time", str(int(WAIT_S))]
        done = subprocess.run([*words, one.url, "-d", READ.decode()], capture_output=True, check=True)
        assert done.stdout == b"|7|"
        url = one.url.replace("webvisu.htm", "plc_visu.xml")
        done = subprocess.run([*words, url], capture_output=True, check=True)
        assert b'<variable name="a">4,0,2,1</variable>' in done.stdout


@pytest.mark.parametrize(
    ("payload", "status"),
    [
        (b"POST / HTTP/1.1\r\nContent-Length: 1048577\r\n\r\n" + bytes(1_048_577), b"413"),
        (b"GET / HTTP/1.1\r\nX: " + b"a" * 200_000, b"431"),
    ],
)
def test_who_sends_too_much_is_told(tmp_path: Path, payload: bytes, status: bytes) -> None:
    with served(tmp_path, TABLE) as one:
        assert asked(one.port, payload).startswith(b"HTTP/1.1 " + status)


def test_who_is_too_slow_is_left(tmp_path: Path) -> None:
    with served(tmp_path, TABLE, slowest_s=0.2) as one, connected(one.port) as slow:
        slow.sendall(post(READ)[:-1])
        assert everything(slow) == b""
        assert one.server.ignored == {SLOW: 1}


def test_a_late_answer_holds_nobody_up(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one, connected(one.port) as waiting:
        waiting.sendall(read_of(2))
        assert asked(one.port, read_of(4)).endswith(b"|0|")
        assert asked(one.port, post(READ)).endswith(b"|7|")


def test_more_connections_than_there_may_be_are_not_listened_to(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one:
        several = [connected(one.port) for _ in range(MOST_CONNECTIONS)]
        for each in several:  # until each was taken
            each.sendall(read_of(8))
        while len(one.posted) < MOST_CONNECTIONS:
            threading.Event().wait(0.01)
        with connected(one.port) as surplus:
            assert everything(surplus) == b""
        assert one.server.ignored[FULL] == 1
        for each in several:
            each.close()


def test_it_ends_after_so_many_requests_and_answers_them_all(tmp_path: Path) -> None:
    told: list[tuple[Handled, str, int]] = []
    with VisuServer(Controller(table_of(tmp_path, TABLE)), LOCAL, 0) as server:
        running = threading.Thread(
            target=server.run, args=(lambda *one: told.append(one), lambda: False), kwargs={"count": 2}
        )
        running.start()
        with connected(server.port) as late:
            late.sendall(read_of(4))
            assert everything(late).endswith(b"|0|")
            own = late.getsockname()[1]
        assert asked(server.port, post(READ)).endswith(b"|7|")
        running.join(WAIT_S)
        assert not running.is_alive()
    assert [(one.result, address) for one, address, _ in told] == [(Result.ANSWERED, LOCAL)] * 2
    assert told[0][2] == own


def test_it_ends_after_a_time_and_when_it_is_told_to(tmp_path: Path) -> None:
    with VisuServer(Controller(table_of(tmp_path, TABLE)), LOCAL, 0) as server:
        server.run(lambda *_: None, lambda: False, lasts_ns=1)
    with served(tmp_path, TABLE) as one:
        waiting = connected(one.port)
        waiting.sendall(read_of(2))
        while not one.posted:
            threading.Event().wait(0.01)
    assert everything(waiting) == b""
    waiting.close()


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.0.2.1"])
def test_nobody_else_is_answered_unless_that_is_allowed(address: str) -> None:
    with pytest.raises(UsageError, match="unless that is allowed"):
        VisuServer(Controller(ServedTable(())), address, unused_port())


def test_a_port_that_somebody_has_is_told() -> None:
    with socket.create_server((LOCAL, 0)) as other, pytest.raises(CaptureError, match="cannot be answered at"):
        VisuServer(Controller(ServedTable(())), LOCAL, int(other.getsockname()[1]))


@given(st.lists(st.binary(max_size=60), max_size=5))
@examples(20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_comes_it_goes_on(tmp_path: Path, came: list[bytes]) -> None:
    with served(tmp_path, TABLE) as one:
        for payload in came:
            asked(one.port, payload)
        assert asked(one.port, post(READ)).endswith(b"|7|")
