"""Both ends of WebVisu conversations on this machine, at ports that the system chooses."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from nvscope.plc.visu.controller import Controller, Handled
from nvscope.plc.visu.http_request import Flaw, HttpRequest, next_request
from nvscope.plc.visu.server import VisuServer
from nvscope.plc.visu.table import ServedTable, read_served
from tests.plc.parameter.peers import LOCAL, WAIT_S, running

PAGE = "/plc/webvisu.htm"


class Recording(Controller):
    """A controller that keeps what it is asked, before anybody has the answer."""

    def __init__(self, table: ServedTable) -> None:
        super().__init__(table)
        self.handled: list[Handled] = []

    def received(self, request: HttpRequest | Flaw) -> Handled:
        handled = super().received(request)
        self.handled.append(handled)
        return handled


class Served(NamedTuple):
    """A controller that is running, its port, and what takes its connections."""

    port: int
    controller: Recording
    server: VisuServer

    @property
    def url(self) -> str:
        return f"http://{LOCAL}:{self.port}{PAGE}"

    @property
    def posted(self) -> list[Handled]:
        """What it was asked but for files."""
        return [one for one in self.controller.handled if one.method == "POST"]


def table_of(folder: Path, variables: str, head: str = "") -> ServedTable:
    """Return a table with these variables, and what stands above them."""
    path = folder / "served.toml"
    path.write_text(f"{head}\n[variables]\n{variables}\n", encoding="utf-8")
    return read_served(path)


@contextmanager
def served(folder: Path, variables: str, head: str = "", *, slowest_s: float = WAIT_S) -> Iterator[Served]:
    """Run a controller with a table."""
    controller = Recording(table_of(folder, variables, head))
    with (
        VisuServer(controller, LOCAL, 0, slowest_s=slowest_s) as server,
        running(lambda is_stopped: server.run(lambda *_: None, is_stopped)),
    ):
        yield Served(server.port, controller, server)


def connected(port: int) -> socket.socket:
    """Return a connection to a port of this machine."""
    return socket.create_connection((LOCAL, port), WAIT_S)


def everything(one: socket.socket) -> bytes:
    """Return all that comes up to the end."""
    came = b""
    with suppress(ConnectionResetError):
        while piece := one.recv(1 << 16):
            came += piece
    return came


def asked(port: int, payload: bytes) -> bytes:
    """Send bytes, and return all that comes back up to the end."""
    with connected(port) as one:
        one.sendall(payload)
        one.shutdown(socket.SHUT_WR)
        return everything(one)


def post(body: bytes, path: str = PAGE) -> bytes:
    """Return a request as a browser sends it."""
    head = f"POST {path} HTTP/1.1\r\nHost: x\r\nContent-Length: {len(body)}\r\n\r\n"
    return head.encode("ascii") + body


def replied(content: bytes, status: str = "200 OK") -> bytes:
    """Return a reply as small servers send it."""
    return f"HTTP/1.0 {status}\r\n\r\n".encode("ascii") + content


Answering = Callable[[socket.socket, HttpRequest, int], None]
"""What a peer does on a connection, given what was asked there and how many requests came before."""


class Peer:
    """A server that does whatever a test wants; ``got`` are the requests that came."""

    def __init__(self, answering: Answering) -> None:
        self._socket, self._answering = socket.create_server((LOCAL, 0)), answering
        self.port = int(self._socket.getsockname()[1])
        self.url = f"http://{LOCAL}:{self.port}{PAGE}"
        self.got: list[HttpRequest] = []

    def run(self, is_stopped: Callable[[], bool]) -> None:
        with self._socket as own:
            own.settimeout(0.05)
            while not is_stopped():
                try:
                    one, _ = own.accept()
                except TimeoutError:
                    continue
                with one, suppress(OSError):
                    one.settimeout(WAIT_S)
                    self._answer(one)

    def _answer(self, one: socket.socket) -> None:
        came, found = b"", None
        while found is None and (piece := one.recv(1 << 16)):
            came += piece
            found, _ = next_request(came, ended=False)
        if isinstance(found, HttpRequest):
            self.got.append(found)
            self._answering(one, found, len(self.got) - 1)


@contextmanager
def peer(answering: Answering | bytes) -> Iterator[Peer]:
    """Run a server that answers so."""
    says = answering
    one = Peer((lambda connection, *_: connection.sendall(says)) if isinstance(says, bytes) else says)
    with running(one.run):
        yield one


def unused_port() -> int:
    """Return a port on which nobody listens."""
    with socket.create_server((LOCAL, 0)) as one:
        return int(one.getsockname()[1])
