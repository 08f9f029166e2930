"""Interrupts: none is lost in a place from which Python lets no exception out."""

from __future__ import annotations

import _thread
import signal
import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs


_SOON_S = 0.01


def lose_no_interrupt() -> None:
    """Let an interrupt that comes while something is being cleaned up come once more behind it.

    In callbacks of weak references, which imports have, and where objects end, Python prints an exception and goes on:
    the first Ctrl-C would do nothing but that.
    """
    usual = sys.unraisablehook

    def again(told: UnraisableHookArgs) -> None:
        if issubclass(told.exc_type, KeyboardInterrupt):
            _thread.start_new_thread(_interrupt_soon, (_thread.get_ident(),))
        else:
            usual(told)

    sys.unraisablehook = again


def comes_of_an_interrupt(error: BaseException) -> bool:
    """Tell whether an error is what Python has made of an interrupt, as it does while it makes a class."""
    cause = error.__cause__
    return isinstance(cause, KeyboardInterrupt) or (cause is not None and comes_of_an_interrupt(cause))


def _interrupt_soon(main: int) -> None:
    """Interrupt the main thread, once it is out of where no exception comes out; also where it waits for something."""
    time.sleep(_SOON_S)
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()
