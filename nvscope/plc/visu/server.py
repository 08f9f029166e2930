"""A port that answers requests of WebVisu pages as a controller does."""

from __future__ import annotations

import contextlib
import socket
import socketserver
import threading
import time
from collections import Counter
from collections.abc import Callable
from math import inf
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Self

from nvscope.errors import CaptureError, UsageError
from nvscope.plc.permission import is_near, plain_address
from nvscope.plc.visu.controller import Controller, Handled, Result
from nvscope.plc.visu.http_request import Flaw, HttpRequest, next_request, waits_for_continue
from nvscope.units import endpoint

MOST_CONNECTIONS = 64
FAR, FULL, SLOW = "from outside of private networks", "one connection too many", "too slow"
CROWDED = "ended to make room for others"
_SLOWEST_S = 10.0
"""How long a request may take to come, and its reply to go."""

_LONGEST_WAIT_S = 0.1
_ROOM_S = 1.0
"""How long a connection that is ended may take to go."""

_MOST_UNTOLD = 1_000
"""So many requests may have been answered that nobody was told of yet: who prints them may be held up."""

_CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"
_PIECE_BYTES = 1 << 16

Told = Callable[[Handled, str, int], None]


class VisuServer:
    """Answers at an address and port of this machine; with port 0 the system chooses one (``port``).

    UsageError where others than this machine and private networks could ask and ``allow_network`` is not set; without
    it, what comes from elsewhere is not answered either. CaptureError where the port cannot be had. ``ignored`` counts
    connections that were not listened to, by why. ``slowest_s`` is for how long a request may come.
    """

    def __init__(
        self, controller: Controller, address: str, port: int, *, allow_network: bool = False,
        slowest_s: float = _SLOWEST_S,
    ) -> None:  # fmt: skip
        own = plain_address(address)
        if own.is_unspecified and not allow_network:
            raise UsageError(
                f"{address} is every address of this machine, and nothing is sent to others unless that is allowed",
                next_step="--allow-network answers them, too; or name one address with --bind",
            )
        if not allow_network and not is_near(address):
            raise UsageError(
                f"{address} is not in a private network, and nothing is sent to others unless that is allowed",
                next_step="--allow-network answers them, too; or name 127.0.0.1",
            )
        self.ignored: Counter[str] = Counter()
        self.allow_network, self.slowest_s = allow_network, slowest_s
        self._controller, self._lock = controller, threading.Lock()
        self._ended, self._stopped = threading.Event(), threading.Event()
        self._open: dict[socket.socket, float] = {}
        self._room = threading.Semaphore(_MOST_UNTOLD)
        self._handled: SimpleQueue[tuple[Handled, str, int]] = SimpleQueue()
        try:
            self._server = _Server(address, port, self)
        except OSError as error:
            raise CaptureError(
                f"cannot be answered at: {error.strerror or error}", where=endpoint(address, port),
                next_step="name an address of this machine with --bind, and with --port a port that no other program "
                "has",
            ) from error  # fmt: skip
        self.port = int(self._server.server_address[1])

    def run(
        self, told: Told, is_stopped: Callable[[], bool], *, count: int | None = None, lasts_ns: int | None = None
    ) -> None:
        """Answer until it is stopped, or ``count`` requests came, or so much time is over.

        ``told`` is given each request with the address and port that it came from, in the order in which they were
        taken; answers that wait at the end are sent when they are due, unless it is stopped.
        """
        end_ns = None if lasts_ns is None else time.monotonic_ns() + lasts_ns
        left = count
        accepting = threading.Thread(target=self._accept)
        accepting.start()
        try:
            while left != 0 and not is_stopped() and (end_ns is None or time.monotonic_ns() < end_ns):
                left = self._tell(told, left, _LONGEST_WAIT_S)
            self._ended.set()
            self._server.shutdown()
            while accepting.is_alive() and not is_stopped():
                accepting.join(_LONGEST_WAIT_S)
        finally:
            self._ended.set()
            self._stopped.set()
            self._server.shutdown()
            with self._lock:
                for one in self._open:
                    _end(one)
            accepting.join()
        while left != 0 and not self._handled.empty():
            left = self._tell(told, left, 0.0)

    def _accept(self) -> None:
        self._server.serve_forever(poll_interval=0.05)
        self._server.server_close()  # waits for all connections

    def _tell(self, told: Told, left: int | None, wait_s: float) -> int | None:
        try:
            told(*self._handled.get(timeout=wait_s))
        except Empty:
            return left
        self._room.release()
        return None if left is None else left - 1

    @property
    def is_ended(self) -> bool:
        """Whether nothing more is answered."""
        return self._ended.is_set()

    def wait(self, delay_ns: int) -> bool:
        """Wait for so long; return whether it goes on then."""
        return not (delay_ns and self._stopped.wait(delay_ns / 1e9))

    def opened(self, connection: socket.socket) -> None:
        """Keep a connection, to end it when everything ends."""
        with self._lock:
            self._open[connection] = time.monotonic()
            if self._stopped.is_set():
                _end(connection)

    def closed(self, connection: socket.socket) -> None:
        """Forget a connection."""
        with self._lock:
            self._open.pop(connection, None)

    def is_listening(self, connection: socket.socket) -> bool:
        """Tell whether somebody on a connection is waited for; not where it was ended to make room."""
        with self._lock:
            return self._open.get(connection, inf) < inf

    def listens(self, connection: socket.socket) -> None:
        """Note that somebody on a connection is waited for from now on."""
        with self._lock:
            self._open[connection] = time.monotonic()

    def make_room(self) -> None:
        """End the connection on which somebody was waited for longest, if there is one: others may have to say more."""
        with self._lock:
            one = min(self._open, key=lambda one: self._open[one], default=None)
            if one is None or self._open[one] == inf:
                return
            self._open[one] = inf
            self.ignored[CROWDED] += 1
            _end(one)

    def take(self, connection: socket.socket, request: HttpRequest | Flaw, address: str, port: int) -> Handled:
        """Take a request, from one connection after the other."""
        while not self._room.acquire(timeout=_LONGEST_WAIT_S):
            if self._stopped.is_set():
                break
        with self._lock:
            self._open[connection] = inf
            handled = self._controller.received(request)
            self._handled.put((handled, address, port))
        return handled

    def ignore(self, why: str) -> None:
        """Count a connection that is not listened to."""
        with self._lock:
            self.ignored[why] += 1

    def close(self) -> None:
        """Close the port."""
        self._server.server_close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _end(connection: socket.socket) -> None:
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)


class _Server(socketserver.ThreadingTCPServer):
    """Takes connections, each in a thread of its own, and no more than there may be."""

    allow_reuse_address = True
    daemon_threads = False
    request_queue_size = MOST_CONNECTIONS

    def __init__(self, address: str, port: int, owner: VisuServer) -> None:
        self.owner = owner
        self.room = threading.BoundedSemaphore(MOST_CONNECTIONS)
        found = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM, flags=socket.AI_NUMERICHOST)[0]
        self.address_family = found[0]
        super().__init__(found[4], _Connection)  # type: ignore[arg-type]

    def verify_request(self, request: Any, client_address: Any) -> bool:
        if not self.owner.allow_network and not is_near(client_address[0]):
            self.owner.ignore(FAR)
            return False
        if not self.room.acquire(blocking=False):
            self.owner.make_room()
            if not self.room.acquire(timeout=_ROOM_S):
                self.owner.ignore(FULL)
                return False
        return True

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        self.owner.opened(request)
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.owner.closed(request)
            self.room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of who goes away in the middle of it; all else is a mistake of ours."""
        import sys  # noqa: PLC0415  # only where something is wrong

        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Connection(socketserver.BaseRequestHandler):
    """One connection: requests and replies in turn, until somebody ends it."""

    request: socket.socket
    server: _Server

    def handle(self) -> None:
        owner = self.server.owner
        address, port = str(plain_address(self.client_address[0])), int(self.client_address[1])
        waiting, ended, asked_for = b"", False, False
        self.request.settimeout(_LONGEST_WAIT_S)
        until_s = time.monotonic() + owner.slowest_s
        while not owner.is_ended:
            found, stop = next_request(waiting, ended=ended)
            if found is None:
                if ended:
                    return
                if not asked_for and waits_for_continue(waiting):
                    asked_for = self._sent(_CONTINUE)
                piece = self._piece(until_s, is_begun=bool(waiting))
                if piece is None:
                    return
                waiting, ended = waiting + piece, not piece
                continue
            waiting = waiting[stop:]
            handled, asked_for = owner.take(self.request, found, address, port), False
            if handled.result is Result.SILENT:
                owner.listens(self.request)
                # Nobody is answered any more here; who asks may wait, or go.
                while self._piece(inf, is_begun=False):
                    pass
                return
            if not owner.wait(handled.delay_ns) or not self._sent(handled.reply) or handled.closes:
                if isinstance(found, Flaw):
                    self._take_rest()
                return
            owner.listens(self.request)
            until_s = time.monotonic() + owner.slowest_s

    def _piece(self, until_s: float, *, is_begun: bool) -> bytes | None:
        """Return what comes next, b'' at the end; None where it takes too long, or everything ends."""
        while time.monotonic() < until_s:
            if self.server.owner.is_ended:
                return None
            try:
                piece = self.request.recv(_PIECE_BYTES)
            except TimeoutError:
                continue
            return piece if piece or self.server.owner.is_listening(self.request) else None
        if is_begun:
            self.server.owner.ignore(SLOW)
        return None

    def _sent(self, reply: bytes) -> bool:
        self.request.settimeout(self.server.owner.slowest_s)
        try:
            self.request.sendall(reply)
        except OSError:
            return False
        self.request.settimeout(_LONGEST_WAIT_S)
        return True

    def _take_rest(self) -> None:
        """Read on for a moment what nobody looks at: a connection closed before would take the reply with it."""
        self.request.shutdown(socket.SHUT_WR)
        until_s, taken = time.monotonic() + 1.0, 0
        while taken < 1 << 22 and (piece := self._piece(until_s, is_begun=False)):
            taken += len(piece)
