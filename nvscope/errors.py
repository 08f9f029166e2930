"""Errors that a person can act on, and the exit code each of them ends the program with.

::

    NvscopeError                     what, where (file, offset, line), what to do next
    ├── UsageError              2    the command line asks for something that cannot be done
    │   └── ConfigurationError  2    a project file, scenario or definition says something unusable
    ├── UnreadableInput         4    a file that is no capture, or not of the kind it should be
    └── CaptureError            5    interface, socket or permission

Bytes from the wire never raise one of these: what is wrong with them is a value (``dissectors.netvar.Fault``).
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum


class ExitCode(IntEnum):
    """What the program's exit status means."""

    GOOD = 0
    ASSERTION_FAILED = 1
    USAGE = 2
    DATA_LOSS = 3
    UNREADABLE = 4
    CAPTURE = 5
    BUG = 70
    INTERRUPTED = 130


class NvscopeError(Exception):
    """Base of all errors of nvscope.

    The texts may hold what stands in files and arguments, in quotes perhaps, and as it is: who shows them escapes them.
    ``str`` of an error has the worst of it escaped, since that goes wherever exceptions go.

    ``what`` happened, ``where`` (file, offset, line; may be empty), and what to do ``next_step`` (may be empty).
    ``excerpt`` are lines of what is wrong with a mark beneath, safe to be shown as they are (may be empty). ``others``
    are what else is wrong, to be told behind it.
    """

    exit_code = ExitCode.BUG

    def __init__(
        self, what: str, *, where: str = "", next_step: str = "", excerpt: Sequence[str] = (),
        others: Sequence[NvscopeError] = (),
    ) -> None:  # fmt: skip
        super().__init__(what)
        self.what = what
        self.where = where
        self.next_step = next_step
        self.excerpt = tuple(excerpt)
        self.others = tuple(others)

    def __str__(self) -> str:
        head = f"{self.where}: {self.what}" if self.where else self.what
        told = "\n  ".join(map(_printable, [head, *self.excerpt, *filter(None, [self.next_step])]))
        return "\n".join([told, *map(str, self.others)])


def _printable(text: str) -> str:
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


class UsageError(NvscopeError):
    exit_code = ExitCode.USAGE


class ConfigurationError(UsageError):
    pass


class UnreadableInput(NvscopeError):
    exit_code = ExitCode.UNREADABLE


class CaptureError(NvscopeError):
    exit_code = ExitCode.CAPTURE
