"""Both ends of conversations on this machine, at ports that the system chooses."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from nvscope.plc.parameter.controller import Controller, Handled
from nvscope.plc.parameter.server import ParameterServer
from nvscope.plc.parameter.table import ServedTable, read_served

LOCAL = "127.0.0.1"
WAIT_S = 20.0
"""Longer than anything takes; nothing waits so long unless it fails."""


def bound(address: str = LOCAL, port: int = 0) -> socket.socket:
    """Return a socket of this machine."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.settimeout(WAIT_S)
    one.bind((address, port))
    return one


def unused_port() -> int:
    """Return a port on which nobody listens."""
    with bound() as one:
        return int(one.getsockname()[1])


@contextmanager
def running(target: Callable[[Callable[[], bool]], None]) -> Iterator[None]:
    """Run something in a thread, which is told when it is to end; what it raises is raised here."""
    ended, raised = threading.Event(), list[BaseException]()

    def run() -> None:
        try:
            target(ended.is_set)
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(WAIT_S)
    assert not thread.is_alive()
    if raised:
        raise raised[0]


class Recording(Controller):
    """A controller that keeps what it is asked, before anybody has the answer."""

    def __init__(self, table: ServedTable) -> None:
        super().__init__(table)
        self.handled: list[Handled] = []

    def received(self, payload: bytes) -> Handled | None:
        handled = super().received(payload)
        if handled is not None:
            self.handled.append(handled)
        return handled


class Served(NamedTuple):
    """A controller that is running, and its port."""

    port: int
    controller: Recording

    @property
    def handled(self) -> list[Handled]:
        return self.controller.handled


@contextmanager
def served(folder: Path, table: str) -> Iterator[Served]:
    """Run a controller with a table."""
    path = folder / "served.toml"
    path.write_text(f"[parameters]\n{table}\n", encoding="utf-8")
    controller = Recording(read_served(path))
    with (
        ParameterServer(controller, LOCAL, 0) as server,
        running(lambda is_stopped: server.run(lambda *_: None, is_stopped)),
    ):
        yield Served(server.port, controller)


Answering = Callable[[bytes, int], Sequence[bytes]]
"""What a peer sends back, given what came and how many came before."""


class Peer:
    """A partner that sends back whatever a test wants; ``got`` are the datagrams that came, with their addresses."""

    def __init__(self, answering: Answering, sender: socket.socket | None = None) -> None:
        self._socket, self._answering = bound(), answering
        self._sender = sender or self._socket
        self.port = int(self._socket.getsockname()[1])
        self.got: list[tuple[bytes, tuple[str, int]]] = []

    def run(self, is_stopped: Callable[[], bool]) -> None:
        self._socket.settimeout(0.05)
        while not is_stopped():
            try:
                payload, source = self._socket.recvfrom(65_535)
            except TimeoutError:
                continue
            answers = self._answering(payload, len(self.got))
            self.got.append((payload, source))
            for answer in answers:
                self._sender.sendto(answer, source)

    def close(self) -> None:
        self._socket.close()


@contextmanager
def peer(answering: Answering, sender: socket.socket | None = None) -> Iterator[Peer]:
    """Run a partner that sends back whatever a test wants; from another socket, if there is one."""
    one = Peer(answering, sender)
    try:
        with running(one.run):
            yield one
    finally:
        one.close()
