"""Last resort: ends the program where the screen was asked to end and does not."""

from __future__ import annotations

import os
import select
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

_STDOUT = 1
_PATIENCE_S = 3.0
_LEAST_S = 0.5
_SIGNALLED = 128
_GIVES_BACK = (
    b"\x1b[?2004l\x1b[?7h\x1b[?2048l\x1b[<u\x1b[?1000l\x1b[?1003l\x1b[?1015l\x1b[?1006l\x1b[?1049l\x1b[?25h\x1b[?1004l"
)
"""Undoes what Textual asks of a terminal, for which its own loop may be stuck."""


class LastResort:
    """Takes the signals that ask for the end; where it does not come, gives the terminal back and ends the program.

    That is so where drawing hangs, or where the terminal takes nothing any more. ``save`` is done before: it closes
    what is being written. A terminal that has gone asks for the end, too: it tells so by SIGHUP those alone whom it
    controls, and others would draw for nobody for ever, such as what a container was asked to run.
    """

    def __init__(self, save: Callable[[], object], patience_s: float = _PATIENCE_S) -> None:
        self._save, self._patience_s = save, patience_s
        self._is_over = threading.Event()
        self._has_begun = False
        self._attributes = _attributes()
        self._before: dict[int, Any] = {}

    def listen(self, end: Callable[[int], object]) -> None:
        """Ask for the end by ``end`` where a signal asks for it; called in the main thread, as that is."""

        def take(number: int, _: FrameType | None) -> None:
            if not self._has_begun:
                self._has_begun = True
                threading.Thread(target=self._wait, args=(number,), name="nvscope last resort", daemon=True).start()
            with suppress(RuntimeError):  # the screen has just ended
                end(number)

        for name in ("SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, take)
        hangup = getattr(signal, "SIGHUP", None)
        if hangup in self._before and hasattr(select, "poll"):
            gone = threading.Thread(
                target=self._wait_for_hangup, args=(lambda: take(hangup, None),), name="nvscope terminal", daemon=True
            )
            gone.start()

    def _wait_for_hangup(self, end: Callable[[], object]) -> None:
        """Wait until nobody is at the other end of the terminal; for ever where that cannot be told."""
        poll = select.poll()
        poll.register(_STDOUT, 0)  # a hangup is always told
        if any(told & select.POLLHUP for _, told in poll.poll()) and not self._is_over.is_set():
            end()

    def over(self) -> None:
        """Take that the screen has ended, and leave signals to whom they were before."""
        self._is_over.set()
        while self._before:
            signal.signal(*self._before.popitem())

    def _wait(self, number: int) -> None:
        if self._is_over.wait(self._patience_s):
            return
        # Each of them may hang as well, as on a terminal that is not read any more.
        for step in (self._save, self._give_back):
            last = threading.Thread(target=step, daemon=True)
            last.start()
            last.join(_LEAST_S)
        os._exit(_SIGNALLED + number)

    def _give_back(self) -> None:
        with suppress(OSError):
            os.write(1, _GIVES_BACK)
        if self._attributes is not None:
            import termios  # noqa: PLC0415  there is none on Windows

            with suppress(termios.error, OSError):
                termios.tcsetattr(0, termios.TCSANOW, self._attributes)


def _attributes() -> list[Any] | None:
    """Return how the terminal is set, None where nobody knows."""
    try:
        import termios  # noqa: PLC0415  there is none on Windows
    except ImportError:
        return None
    try:
        return termios.tcgetattr(0)
    except (termios.error, OSError):
        return None
