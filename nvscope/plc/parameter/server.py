"""A socket that answers requests of the Parameter Manager as a controller does."""

from __future__ import annotations

import heapq
import select
import socket
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from nvscope.errors import CaptureError, UsageError
from nvscope.plc.parameter.controller import Controller, Handled
from nvscope.plc.permission import is_near, plain_address
from nvscope.units import endpoint

FAR, UNSENT = "from outside of private networks", "answers that could not be sent"
_DATAGRAM_BYTES = 65_535
_LONGEST_WAIT_NS = 100_000_000
_MOST_AT_ONCE = 64
_MOST_WAITING = 10_000


class ParameterServer:
    """Answers at an address and port of this machine; with port 0 the system chooses one (``port``).

    UsageError where others than this machine and private networks could ask and ``allow_network`` is not set; without
    it, what comes from elsewhere is not answered either. CaptureError where the port cannot be had.
    """

    def __init__(self, controller: Controller, address: str, port: int, *, allow_network: bool = False) -> None:
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
        self._controller, self._allow_network = controller, allow_network
        self._waiting: list[tuple[int, int, bytes, Any]] = []
        self._number = 0
        try:
            family, _, _, _, target = socket.getaddrinfo(
                address, port, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST
            )[0]
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
        except OSError as error:
            raise _failure(address, port, error) from error
        try:
            self._socket.bind(target)
        except OSError as error:
            self._socket.close()
            raise _failure(address, port, error) from error
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])

    def run(
        self, told: Callable[[Handled, str, int], None], is_stopped: Callable[[], bool], *,
        count: int | None = None, lasts_ns: int | None = None,
    ) -> None:  # fmt: skip
        """Answer until it is stopped, or ``count`` requests came, or so much time is over.

        ``told`` is given each request with the address and port that it came from, when the answer was sent or is
        waiting to be; answers that wait at the end are sent when they are due, unless it is stopped.
        """
        end_ns = None if lasts_ns is None else time.monotonic_ns() + lasts_ns
        left = count
        while not is_stopped():
            now_ns = time.monotonic_ns()
            self._send_due(now_ns)
            is_over = left == 0 or (end_ns is not None and now_ns >= end_ns)
            if is_over and not self._waiting:
                return
            nexts = [now_ns + _LONGEST_WAIT_NS, *([end_ns] if end_ns is not None and not is_over else [])]
            nexts += [self._waiting[0][0]] if self._waiting else []
            wait_s = max(min(nexts) - now_ns, 0) / 1e9
            if is_over:
                time.sleep(wait_s)
            elif select.select([self._socket], [], [], wait_s)[0]:
                left = self._take(told, left)

    def _take(self, told: Callable[[Handled, str, int], None], left: int | None) -> int | None:
        for _ in range(_MOST_AT_ONCE):
            if left == 0:
                break
            try:
                payload, source = self._socket.recvfrom(_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except OSError:
                continue  # an answer came back: nobody waits for it any more
            if not self._allow_network and not is_near(source[0]):
                self._controller.ignored[FAR] += 1
                continue
            handled = self._controller.received(payload)
            if handled is None:
                continue
            self._answer(handled, source)
            told(handled, str(plain_address(source[0])), int(source[1]))
            left = None if left is None else left - 1
        return left

    def _answer(self, handled: Handled, source: Any) -> None:
        if not handled.delay_ns:
            for datagram in handled.datagrams:
                self._send(datagram, source)
            return
        due_ns = time.monotonic_ns() + handled.delay_ns
        for datagram in handled.datagrams:
            if len(self._waiting) >= _MOST_WAITING:
                self._controller.ignored[UNSENT] += 1
                continue
            self._number += 1
            heapq.heappush(self._waiting, (due_ns, self._number, datagram, source))

    def _send_due(self, now_ns: int) -> None:
        while self._waiting and self._waiting[0][0] <= now_ns:
            _, _, datagram, source = heapq.heappop(self._waiting)
            self._send(datagram, source)

    def _send(self, datagram: bytes, source: Any) -> None:
        for again in (True, False):
            try:
                self._socket.sendto(datagram, source)
                return
            except OSError:
                # What is told here may be of an answer before.
                if not again:
                    self._controller.ignored[UNSENT] += 1

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _failure(address: str, port: int, error: OSError) -> CaptureError:
    return CaptureError(
        f"cannot be answered at: {error.strerror or error}", where=endpoint(address, port),
        next_step="name an address of this machine with --bind, and with --port a port that no other program has",
    )  # fmt: skip
