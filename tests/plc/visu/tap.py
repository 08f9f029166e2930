"""What stands between a client and a served WebVisu, and keeps what they say as a capture."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.capture.mcap.recordings import Packet, write
from tests.oracle.frame import Frame
from tests.oracle.tcp_line import Line
from tests.plc.parameter.peers import LOCAL, WAIT_S, running
from tests.plc.visu.peers import connected

CLIENT, SERVER = "192.168.1.5", ("192.168.1.20", 80)
_FIRST_PORT, _SEGMENT_BYTES = 50_000, 1_400


class Tap:
    """Hands on one connection after the other, each as a connection of a capture."""

    def __init__(self, port: int) -> None:
        self._port, self._socket = port, socket.create_server((LOCAL, 0))
        self.port = int(self._socket.getsockname()[1])
        self._lines: list[Line] = []

    def run(self, is_stopped: Callable[[], bool]) -> None:
        with self._socket as own:
            own.settimeout(0.05)
            while not is_stopped():
                try:
                    client, _ = own.accept()
                except TimeoutError:
                    continue
                with client, connected(self._port) as server:
                    client.settimeout(WAIT_S)
                    self._hand_on(client, server)

    def _hand_on(self, client: socket.socket, server: socket.socket) -> None:
        line = Line((CLIENT, _FIRST_PORT + len(self._lines)), SERVER, now=time.time_ns())
        line.open()
        self._lines.append(line)
        lock = threading.Lock()
        back = threading.Thread(target=_pump, args=(server, client, line, False, lock))
        back.start()
        _pump(client, server, line, True, lock)
        back.join(WAIT_S)

    def capture(self, path: Path) -> Path:
        """Write it as if it had been on a network."""
        frames: list[Frame] = sorted((one for line in self._lines for one in line.frames), key=lambda one: one.ts_ns)
        return write(path, [Packet(one.data, one.original, one.ts_ns, one.link) for one in frames])


def _pump(source: socket.socket, target: socket.socket, line: Line, from_client: bool, lock: threading.Lock) -> None:
    piece = b"?"
    while piece:
        try:
            piece = source.recv(1 << 16)
        except OSError:
            piece = b""
        with lock:
            line.now = max(line.now, time.time_ns())
            for start in range(0, len(piece), _SEGMENT_BYTES):
                line.say(from_client, piece[start : start + _SEGMENT_BYTES])
            if not piece:
                line.close(from_client)
        with suppress(OSError):
            target.sendall(piece)
            if not piece:
                target.shutdown(socket.SHUT_WR)


@contextmanager
def tapped(port: int) -> Iterator[Tap]:
    """Run a tap in front of a port."""
    one = Tap(port)
    with running(one.run):
        yield one
