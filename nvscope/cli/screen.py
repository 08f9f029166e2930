"""What verbs share that show the screen: its options, and whether there can be one."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from nvscope.capture.content import STDIN
from nvscope.cli.counts import at_least_one

RING_MIB = 256
SIGNALLED = 128
"""Shells add it to the signal that ended a program."""

RingOption = Annotated[
    int,
    typer.Option(
        "--ring", metavar="MIB", parser=at_least_one, help="The last frames are kept in so many MiB of memory."
    ),
]
ThemeOption = Annotated[
    str | None, typer.Option("--theme", metavar="NAME", help="Colours of the screen: dark, light, ansi, or mono.")
]


def has_screen(captures: Sequence[str]) -> bool:
    """Tell whether stdout is a terminal with keys: on stdin, or, where that is the capture, at the terminal itself."""
    if not sys.stdout.isatty() or os.environ.get("TERM") == "dumb":
        return False  # nothing can be drawn on it
    if sys.stdin is None or sys.stdin.isatty():
        return sys.stdin is not None
    if STDIN not in captures:
        return False
    try:
        terminal = os.open("/dev/tty", os.O_RDWR)
    except OSError:
        return False
    # The capture is read from where stdin leads now; the screen reads keys from descriptor 0.
    sys.stdin = os.fdopen(os.dup(0))
    os.dup2(terminal, 0)
    os.close(terminal)
    return True


def clock(utc: bool) -> Callable[[int], str]:
    """Return what tells moments by the clock on the wall."""
    from nvscope.units import clock_time

    return lambda time_ns: clock_time(time_ns, utc=utc, digits=0)
