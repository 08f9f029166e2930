"""A controller on this machine, asked by plain sockets with bytes made by hand."""

from __future__ import annotations

import socket
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.errors import CaptureError, UsageError
from nvscope.plc.parameter.controller import Controller, Handled
from nvscope.plc.parameter.server import UNSENT, ParameterServer
from nvscope.plc.parameter.table import ServedTable, read_served
from tests.laws import examples
from tests.plc.parameter.peers import LOCAL, bound, served, unused_port
from tests.plc.parameter.wire import (
    ACCESS,
    BUSY,
    INDEX,
    ITEMS,
    LENGTH,
    READ,
    READ_REPLY,
    WRITE,
    WRITE_REPLY,
    heard,
    said,
)

TABLE = """
"0x2000:1" = { type = "UINT", value = 7 }
"0x2000:2" = { type = "UINT", value = 7, access = "ro" }
"0x2000:3" = { type = "UINT", value = 7, busy = 1 }
"0x2000:4" = { type = "UINT", value = 7, duplicate = true }
"0x2000:5" = { type = "UINT", value = 7, silent = true }
"0x2000:6" = { type = "UINT", value = 7, delay = "50ms" }
"0x2000:7" = { type = "UINT", value = 7, wrong_counter = true }
"""


@pytest.fixture
def table(tmp_path: Path) -> ServedTable:
    path = tmp_path / "t.toml"
    path.write_text(f"[parameters]{TABLE}", encoding="utf-8")
    return read_served(path)


def test_each_service_is_answered_to_where_it_came_from(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one, bound() as asking, bound("127.0.0.1") as other:

        def ask(payload: bytes, by: socket.socket = asking) -> tuple[int, bytes]:
            by.sendto(payload, (LOCAL, one.port))
            answer, source = by.recvfrom(65_535)
            assert source == (LOCAL, one.port)
            return heard(answer).service, heard(answer).data

        assert ask(said(READ)) == (READ_REPLY, b"\7\0")
        assert ask(said(WRITE, data=b"\1\2"), other) == (WRITE_REPLY, b"")
        assert ask(said(READ)) == (READ_REPLY, b"\1\2")
        assert ask(said(WRITE, data=b"\1")) == (LENGTH, b"")
        assert ask(said(READ, items=2)) == (ITEMS, b"")
        assert ask(said(WRITE, subindex=2, data=b"\1\2")) == (ACCESS, b"")
        assert ask(said(READ, index=1)) == (INDEX, b"")
        assert ask(said(READ, subindex=3)) == (BUSY, b"")
        assert ask(said(READ, subindex=3)) == (READ_REPLY, b"\7\0")
        assert ask(said(READ, subindex=6)) == (READ_REPLY, b"\7\0")


def test_what_is_not_to_be_answered_is_not(tmp_path: Path) -> None:
    """What is sent behind it is answered first: datagrams of one socket to another keep their order here."""
    came = b"", b"garbage", said(READ, subindex=5), said(0), said(READ_REPLY), said(READ)[:10], said(READ)
    with served(tmp_path, TABLE) as one, bound() as asking:
        for payload in came:
            asking.sendto(payload, (LOCAL, one.port))
        assert asking.recv(65_535) == said(READ_REPLY, data=b"\7\0")
    assert [handled.request.subindex for handled in one.handled] == [5, 1]
    assert dict(one.controller.ignored) == {"no telegram": 2, "about a list": 1, "no request": 1, "malformed": 1}


def test_duplicates_and_wrong_counters_come_where_they_are_asked_for(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one, bound() as asking:
        asking.sendto(said(READ, subindex=4), (LOCAL, one.port))
        asking.sendto(said(READ, subindex=7, counter=65535), (LOCAL, one.port))
        twice = said(READ_REPLY, subindex=4, data=b"\7\0")
        assert [asking.recv(65_535) for _ in range(3)] == [
            twice, twice, said(READ_REPLY, subindex=7, counter=0, data=b"\7\0"),
        ]  # fmt: skip


def test_a_delayed_answer_holds_nobody_up(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one, bound() as asking:
        asking.sendto(said(READ, subindex=6), (LOCAL, one.port))
        asking.sendto(said(READ), (LOCAL, one.port))
        assert [heard(asking.recv(65_535)).subindex for _ in range(2)] == [1, 6]


def test_it_ends_after_so_many_requests_and_answers_them_all(table: ServedTable) -> None:
    with bound() as asking, ParameterServer(Controller(table), LOCAL, 0) as server:
        for subindex in (6, 5, 1):
            asking.sendto(said(READ, subindex=subindex), (LOCAL, server.port))
        told: list[tuple[Handled, str, int]] = []
        server.run(lambda *one: told.append(one), lambda: False, count=2)
        assert [(one.request.subindex, address, port) for one, address, port in told] == [
            (6, LOCAL, asking.getsockname()[1]), (5, LOCAL, asking.getsockname()[1]),
        ]  # fmt: skip
        assert heard(asking.recv(65_535)).subindex == 6


def test_it_ends_after_a_time(table: ServedTable) -> None:
    with ParameterServer(Controller(table), LOCAL, 0) as server:
        server.run(lambda *_: None, lambda: False, lasts_ns=1)


def test_who_asks_and_goes_away_ends_nothing(tmp_path: Path) -> None:
    with served(tmp_path, TABLE) as one, bound() as asking:
        for _ in range(20):
            with bound() as gone:
                gone.sendto(said(READ, subindex=6), (LOCAL, one.port))
                gone.sendto(said(READ), (LOCAL, one.port))
        asking.sendto(said(READ, subindex=6), (LOCAL, one.port))
        assert heard(asking.recv(65_535)).service == READ_REPLY
    assert one.controller.ignored[UNSENT] == 0


@pytest.mark.skipif(sys.platform != "linux", reason="who has ::1")
def test_it_answers_over_ipv6(table: ServedTable) -> None:
    if not socket.has_ipv6 or not Path("/proc/net/if_inet6").exists():
        pytest.skip("no IPv6")
    with (
        ParameterServer(Controller(table), "::1", 0) as server,
        socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as one,
    ):
        one.settimeout(20)
        one.sendto(said(READ), ("::1", server.port))
        told: list[str] = []
        server.run(lambda handled, address, port: told.append(address), lambda: False, count=1)
        assert (told, heard(one.recv(65_535)).data) == (["::1"], b"\7\0")


def test_a_port_that_somebody_has_is_told(table: ServedTable) -> None:
    with bound() as other, pytest.raises(CaptureError, match="cannot be answered at"):
        ParameterServer(Controller(table), LOCAL, int(other.getsockname()[1]))


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "192.0.2.1", "8.8.8.8"])
def test_nobody_else_is_answered_unless_that_is_allowed(table: ServedTable, address: str) -> None:
    with pytest.raises(UsageError, match="unless that is allowed") as raised:
        ParameterServer(Controller(table), address, unused_port())
    assert "--allow-network" in raised.value.next_step


@given(st.lists(st.binary(max_size=60) | st.builds(said, st.integers(0, 6), data=st.binary(max_size=3)), max_size=20))
@examples(40)
def test_whatever_comes_it_goes_on(came: Sequence[bytes]) -> None:
    table = ServedTable(())
    with bound() as asking, ParameterServer(Controller(table), LOCAL, 0) as server:
        for payload in came:
            asking.sendto(payload, (LOCAL, server.port))
        asking.sendto(said(READ, counter=9, subindex=99), (LOCAL, server.port))
        handled: list[Handled] = []
        server.run(
            lambda one, *_: handled.append(one), lambda: bool(handled) and handled[-1].request.subindex == 99
        )  # fmt: skip
        answers = [heard(asking.recv(65_535)) for _ in handled]
    assert {one.service for one in answers} == {INDEX}
    assert [one.index for one in answers] == [one.request.index for one in handled]
