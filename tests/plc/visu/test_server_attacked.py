"""A controller's WebVisu and who means harm, or does not know better: others are served all the same."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.plc.visu.controller import Controller, Handled, Result
from nvscope.plc.visu.server import CROWDED, FULL, MOST_CONNECTIONS, SLOW, VisuServer
from nvscope.plc.visu.table import ServedTable
from tests.laws import examples
from tests.plc.parameter.peers import LOCAL, WAIT_S, running
from tests.plc.visu.asked_server import KEPT, READ, READ_REPLY, VARIABLES, content, statuses
from tests.plc.visu.peers import PAGE, Served, asked, connected, everything, post, served, table_of


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Served]:
    with served(tmp_path, VARIABLES) as one:
        yield one


@pytest.mark.parametrize(
    ("payload", "status"),
    [
        (b"\x16\x03\x01\x02\x00\x01\n", 400),
        (b"|0|1|0|0|6|1|2|", 400),
        (b"POST /webvisu.htm HTTP/1.1\r\nContent-Length: x\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nX: " + b"y" * 100_000, 431),
        (b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 1_000_000, 431),
        (post(b"")[:-4] + b"0000000\r\n\r\n" + bytes(10), 400),
        (f"POST {PAGE} HTTP/1.1\r\nContent-Length: 99999999\r\n\r\n".encode() + bytes(100_000), 413),
        (post(b"|0|1000000" + b"|0" * 500_000 + b"|"), 200),
        (post(b"|1|1000000" + b"|0" * 500_000 + b"|"), 400),
        (post(b"|0|1|0|" + b"9" * 1_000_000), 400),
        (post(b"|0|" + b"9" * 1_000_000 + b"|0|0|6|1|2|"), 200),
        (post(b"\xff\0" * 1_000), 400),
    ],
)
def test_what_is_too_much_or_none_gets_a_status_and_others_are_served(
    controller: Served, payload: bytes, status: int
) -> None:
    with connected(controller.port) as client:
        replies = b""
        try:
            client.sendall(payload)
            client.shutdown(socket.SHUT_WR)
        except OSError:  # it was left, before or while that was said
            pass
        replies = everything(client)
    assert statuses(replies)[:1] in ([status], [])  # who goes on sending may not get to read what he was told
    assert [one.status for one in controller.controller.handled][:1] == [status]
    assert content(asked(controller.port, post(READ))) == READ_REPLY


def test_who_drips_is_given_up(tmp_path: Path) -> None:
    with served(tmp_path, VARIABLES, slowest_s=0.3) as one, connected(one.port) as slow:
        begun_s = time.monotonic()
        try:
            while time.monotonic() - begun_s < WAIT_S:
                slow.sendall(b"X")
                time.sleep(0.02)
        except OSError:  # it was left, before or while that was said
            pass
        assert time.monotonic() - begun_s < WAIT_S
        assert one.server.ignored == {SLOW: 1}
        assert content(asked(one.port, post(READ))) == READ_REPLY


def test_who_does_not_read_is_given_up(tmp_path: Path) -> None:
    many = b"|0|5000" + b"|0|4|0|201|8" * 5_000 + b"|"
    long = "x" * 200
    variables = f'"sLong" = {{ address = "4,0,201,8", value = "{long}" }}\n"n" = {{ address = "0,6,1,2", value = 3 }}'
    with served(tmp_path, variables, KEPT, slowest_s=0.3) as one, connected(one.port) as deaf:
        deaf.settimeout(0.1)
        try:
            while True:
                deaf.sendall(post(many))
        except OSError:
            pass
        assert content(asked(one.port, post(READ).replace(b"Host", b"Connection: close\r\nHost"))) == READ_REPLY


def test_who_only_holds_connections_makes_room_for_others(tmp_path: Path) -> None:
    """Some say nothing, some stop in the middle, some wait for what never comes: the oldest of them goes."""
    beginnings = b"", post(READ)[:30], post(b"|0|1|0|4|14|2|1|")
    with served(tmp_path, VARIABLES) as one, ExitStack() as holding:
        for number in range(MOST_CONNECTIONS):
            client = holding.enter_context(connected(one.port))
            client.sendall(beginnings[number % 3])
        for _ in range(3):
            assert content(asked(one.port, post(READ))) == READ_REPLY
        assert one.server.ignored[CROWDED] >= 1
        assert one.server.ignored[FULL] == 0
        assert Result.MALFORMED not in one.controller.results


def test_who_is_being_answered_is_not_sent_away(tmp_path: Path) -> None:
    late = '"late" = { address = "4,0,2,1", delay = "30s" }'
    with served(tmp_path, late) as one, ExitStack() as holding:
        clients = [holding.enter_context(connected(one.port)) for _ in range(MOST_CONNECTIONS)]
        for client in clients:
            client.sendall(post(b"|0|1|0|4|0|2|1|"))
        while len(one.posted) < MOST_CONNECTIONS:
            time.sleep(0.01)
        assert asked(one.port, post(b"|0|1|0|4|0|2|1|")) == b""
        assert one.server.ignored == {FULL: 1}
        for client in clients:
            client.setblocking(False)
            with pytest.raises(BlockingIOError):
                client.recv(1)


def test_who_goes_away_in_the_middle_ends_nothing(controller: Served, capfd: pytest.CaptureFixture[str]) -> None:
    for payload in (b"", b"GET", post(READ)[:-3], post(READ), post(b"|0|1|0|4|12|2|1|")):
        with connected(controller.port) as gone:
            gone.sendall(payload)
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    assert content(asked(controller.port, post(READ))) == READ_REPLY
    assert capfd.readouterr().err == ""


def test_who_is_told_slowly_does_not_pile_up_what_was_asked(tmp_path: Path) -> None:
    """Requests wait until those before them were told, and all of them are."""
    table, goes_on = table_of(tmp_path, VARIABLES, KEPT), threading.Event()
    controller, told = Controller(table), list[Handled]()

    def tell(handled: Handled, *_: object) -> None:
        goes_on.wait(WAIT_S)
        told.append(handled)

    with (
        VisuServer(controller, LOCAL, 0) as server,
        running(lambda is_stopped: server.run(tell, is_stopped)),
        connected(server.port) as client,
    ):
        sending = threading.Thread(target=lambda: client.sendall(post(READ) * 3_000))
        sending.start()
        while controller.results.total() < 1_000:
            time.sleep(0.01)
        time.sleep(0.1)
        assert controller.results.total() < 1_010
        goes_on.set()
        # The last reply may be here before anybody is told of it.
        client.settimeout(0.1)
        while len(told) < 3_000:
            with suppress(TimeoutError):
                assert client.recv(1 << 20)
        sending.join()


@given(st.lists(st.binary(max_size=60) | st.builds(post, st.binary(max_size=30)), max_size=6))
@examples(30)
def test_whatever_comes_it_goes_on(came: Sequence[bytes]) -> None:
    with (
        VisuServer(Controller(ServedTable(())), LOCAL, 0) as server,
        running(lambda is_stopped: server.run(lambda *_: None, is_stopped)),
    ):
        for payload in came:
            replies = asked(server.port, payload)
            assert set(statuses(replies)) <= {400, 404, 405, 413, 431}
        assert statuses(asked(server.port, b"GET /none HTTP/1.0\r\n\r\n")) == [404]
