"""A CAN bus as an inlet, by any driver of python-can; nothing is ever sent on it.

Drivers are foreign: they block, they raise whatever they like, and some do not come back. So each has a thread of its
own, in which its bus is opened, read, and closed; who looks at the frames never waits for it.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from dissectors.batch import PacketBatch
from nvscope.capture.can.frame import CanFrame, CanRows, FrameBatches
from nvscope.capture.can.line_fields import LineFault
from nvscope.capture.live.can.bus_clock import BusClock
from nvscope.capture.live.can.drivers import driver_of
from nvscope.capture.live.can.library import opened, reason
from nvscope.capture.live.can.message import State, frame_of, state_in
from nvscope.capture.live.can.word import CanWord
from nvscope.capture.live.queued_inlet import CLOSE_S, QueuedInlet
from nvscope.capture.source import DropsPart
from nvscope.errors import CaptureError

GATHER_NS = 100_000_000
"""So long frames are gathered to a batch."""

OPEN_S, HANG_S = 20.0, 10.0
"""How long a driver may take: to open a bus, to close it, and for what should be done in ``_LOOK_S``."""

_LOOK_S = 0.1
_PAUSE_S = 0.05
_REST_S = 0.3
_COMPLAINS_S = 1.0
"""A driver that raises what is wrong with a bus does so, while nothing comes, at least so often."""

_MOST_LOOKS = 50
_MOST_FAILURES = 10
_GONE = (errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EBADF, errno.EIO)
_SO_MEMINFO, _MEMINFO_DROPS, _MEMINFO_COUNT = 55, 8, 9


class CanBus(QueuedInlet[CanFrame]):
    """The frames of a CAN bus; an ``Inlet``. ``name`` is what its channel is called, that of the word if it is ''.

    What the driver cannot read, and what is no frame, counts as lost in the interface. Raises UsageError for a word
    that cannot be understood, CaptureError where the bus cannot be opened.
    """

    format = "can"
    hears_answers = True

    def __init__(self, word: str, name: str = "") -> None:
        super().__init__(_batch_of, GATHER_NS)
        self.path = word
        self._where = where = CanWord.of(word)
        self.channels: Sequence[str] = [name or where.name]
        self.lag_ns = GATHER_NS + 100_000_000
        self._driver = driver_of(where.interface)
        self._clock = BusClock(self._driver.clock)
        self._unread = 0
        self._kernel_drops: int | None = 0 if self._driver.is_virtual else None
        self._failure = ""
        self._state = State.GOOD
        self._complained_s = -_COMPLAINS_S
        self._rounds = self._rounds_seen = self._looks = 0
        self._moved_s = time.monotonic()
        self._opened = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._live, name=word, daemon=True)
        self._thread.start()
        try:
            is_open = self._opened.wait(OPEN_S)
            if not is_open:
                raise CaptureError(
                    f"its driver has not answered for {OPEN_S:.0f} s", where=word,
                    next_step="look at the adapter: unplug it, plug it in again",
                )  # fmt: skip
            if self._error is not None:
                raise reason(where, word, self._error) from self._error
        except BaseException:
            self.close()
            raise

    # In the thread of the driver.

    def _live(self) -> None:
        try:
            bus = opened(self._where, self._driver)
        except BaseException as error:
            self._error = error
            self._opened.set()
            return
        self._opened.set()
        try:
            self._receive(bus)
        except BaseException as error:
            self._failure = _told(error)
        self._rested.set()
        self._queue.wake()
        with suppress(BaseException):
            bus.shutdown()

    def _receive(self, bus: Any) -> None:
        """Receive until it is to be closed, and then what is there."""
        usual, failures, looked_s, until_s = _state_of(bus), 0, 0.0, 0.0
        while True:
            if self._closing.is_set():
                until_s = until_s or time.monotonic() + _REST_S
            try:
                message = bus.recv(0 if until_s else _LOOK_S)
            except Exception as error:
                if _is_gone(error):
                    raise
                state = state_in(str(error))
                if state is None:
                    self._unread += 1
                    failures += 1
                    if failures > _MOST_FAILURES:
                        raise
                else:
                    self._complained_s = time.monotonic()
                    self._enter(state)
                if until_s or (failures != 1 and self._closing.wait(_PAUSE_S)):
                    return
                continue
            finally:
                self._rounds += 1
            failures = 0
            if message is not None:
                self._put(message)
            if (until_s and message is None) or 0 < until_s < time.monotonic():
                return
            if time.monotonic() - looked_s > 2 * _LOOK_S:
                looked_s = time.monotonic()
                self._look(bus, usual)

    def _put(self, message: Any) -> None:
        try:
            ts_ns = self._clock.ns(float(message.timestamp), time.time_ns())
            self._queue.put(frame_of(message, ts_ns, has_classes=self._driver.has_classes))
        except (LineFault, AttributeError, TypeError, ValueError):
            self._unread += 1

    def _look(self, bus: Any, usual: str) -> None:
        """Look at the state of the bus, and at what its socket has lost, if it has one."""
        told = _state_of(bus)
        # PASSIVE from the beginning on is how some drivers say that they listen only.
        state = State.GOOD if told == usual != "ERROR" else _STATES.get(told, State.GOOD)
        if state is not State.GOOD or time.monotonic() - self._complained_s > _COMPLAINS_S:
            self._enter(state)
        drops = _socket_drops(bus)
        if drops is not None:
            self._kernel_drops = drops

    def _enter(self, state: State) -> None:
        if state is not self._state:
            self._state = state
            self._queue.put(state.frame(time.time_ns()))

    # In the thread of who looks at the frames.

    def drops(self) -> Mapping[str, int] | None:
        told = {DropsPart.QUEUE.value: self._queue.dropped, DropsPart.INTERFACE.value: self._unread}
        if self._kernel_drops is None:
            return told if any(told.values()) else None
        return told | {DropsPart.KERNEL.value: self._kernel_drops}

    def failure(self) -> str:
        if not self._failure and not self._closing.is_set():
            self._look_for_life()
        return self._failure

    def _look_for_life(self) -> None:
        """Say so where the driver does not come back; time alone does not tell, since the whole process may rest."""
        if self._rounds != self._rounds_seen:
            self._rounds_seen, self._looks, self._moved_s = self._rounds, 0, time.monotonic()
            return
        self._looks += 1
        if self._looks > _MOST_LOOKS and time.monotonic() - self._moved_s > HANG_S:
            self._failure = f"its driver has not answered for {HANG_S:.0f} s"

    def close(self) -> None:
        self._closing.set()
        # One that does not come back is left behind; it ends with the process.
        self._thread.join(CLOSE_S)
        self._queue.close()


def _batch_of(frames: Sequence[CanFrame]) -> PacketBatch:
    return next(FrameBatches(len(frames)).add(CanRows.of(list(frames), [0] * len(frames))))


_STATES: Mapping[str, State] = {"PASSIVE": State.PASSIVE, "ERROR": State.OFF}


def _state_of(bus: Any) -> str:
    """Return the name of the state of a bus, '' where its driver does not say."""
    try:
        return str(bus.state.name)
    except Exception:
        return ""


def _is_gone(error: BaseException | None) -> bool:
    """Return whether an error says that nothing can come any more."""
    while error is not None:
        if isinstance(error, OSError) and not isinstance(error, TimeoutError | BlockingIOError | InterruptedError):
            return True
        if getattr(error, "error_code", None) in _GONE:
            return True
        error = error.__cause__
    return False


def _told(error: BaseException) -> str:
    while error.__cause__ is not None and isinstance(error.__cause__, OSError):
        error = error.__cause__
    if isinstance(error, OSError) and error.errno in (errno.ENETDOWN, errno.ENODEV):
        return "the interface is down" if error.errno == errno.ENETDOWN else "the interface is gone"
    return f"its driver failed: {str(error) or type(error).__name__}"


def _socket_drops(bus: Any) -> int | None:
    """Return what the kernel dropped for want of room in the socket of a bus, None where nobody knows."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        with socket.socket(fileno=os.dup(bus.fileno())) as own:
            told = own.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * _MEMINFO_COUNT)
    except Exception:
        return None
    numbers = struct.unpack(f"@{len(told) // 4}I", told)
    return numbers[_MEMINFO_DROPS] if len(numbers) > _MEMINFO_DROPS else None
