"""What happens where a mapped file loses bytes that are being read: another program cuts it, or its share fails.

The system then stops the process at the instruction that reads (SIGBUS), with nothing for Python to catch. To copy all
files instead costs a fifth of the speed, for what hardly ever happens. So a handler says what happened, and ends.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

_STDERR = 2
_SENTENCE = (
    "nvscope: {path}: the file was cut, or cannot be read any more, while it was read\n"
    "  read it again when nobody writes it; a copy on a local disk helps against a share that fails\n"
)

_at_end: Callable[[], int] | None = None
_paths: dict[int, str] = {}
_handler: Any = None


def end_in_words(at_end: Callable[[], int]) -> None:
    """Let bus errors end the process with a sentence; ``at_end`` tidies up and returns the exit code.

    It is for a program of our own: the process of a notebook is somebody else's.
    """
    global _at_end  # noqa: PLW0603  # a process has one handler
    _at_end = at_end


def mapped(number: int, path: str) -> None:
    """Note that a file is mapped; ``number`` is the caller's, for ``unmapped``."""
    if _at_end is None or not hasattr(signal, "SIGBUS"):
        return
    _paths[number] = path
    _install()


def unmapped(number: int) -> None:
    """Note that it no longer is."""
    _paths.pop(number, None)


def _install() -> None:
    global _handler  # noqa: PLW0603
    if _handler is not None:
        return
    import ctypes  # noqa: PLC0415  # not before a large file is read

    # Python's own handlers run between instructions of Python, and this one would never end.
    _handler = ctypes.CFUNCTYPE(None, ctypes.c_int)(_ended)
    install = ctypes.CDLL(None).signal
    install.restype, install.argtypes = ctypes.c_void_p, (ctypes.c_int, type(_handler))
    install(signal.SIGBUS, _handler)


def _ended(_: int) -> None:
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    told = ", ".join(dict.fromkeys(_paths.values())) or "a file"
    os.write(_STDERR, _SENTENCE.format(path="".join(c if c.isprintable() else "?" for c in told)).encode())
    os._exit(_at_end() if _at_end else 1)
