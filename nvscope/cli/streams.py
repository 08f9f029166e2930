"""stdin, stdout and stderr as whoever started the program left them, made so that nothing is lost in them silently."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterable
from typing import Any, cast

from nvscope.cli.encodings import adapt

_NAMES = ("stdin", "stdout", "stderr")
_STDIN, _STDOUT, _STDERR = range(len(_NAMES))
_KEPT: list[Any] = []


def prepare() -> None:
    """Make the streams whole: each waits for its reader, takes every character, and says when it cannot be written."""
    for name in _NAMES:
        if getattr(sys, name) is None:
            # The shell closed it. The next file that is opened would get its number, and what is meant for it.
            os.open(os.devnull, os.O_RDONLY)
    _let_wait("stdout")
    _let_wait("stderr")
    sys.stdout = _stdout()
    sys.stderr = _stderr_that_never_fails()
    for stream in (sys.stdout, sys.stderr):
        adapt(stream)


def drop_output() -> None:
    """Let what is left of the output go nowhere; Python would complain once more when it flushes at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def refuse_streams_onto(inputs: Iterable[str | os.PathLike[str]]) -> None:
    """Raise UsageError where stdout or stderr goes to one of the files that are read: what is told would end up in it.

    A shell has emptied a file that stands behind ``>``, and only what stands behind ``>>`` can still be saved. Where it
    is stderr, stdout tells the error.
    """
    streams = {identity: number for number in (_STDERR, _STDOUT) if (identity := _regular(number)) is not None}
    if not streams:
        return
    from nvscope.whole_files import is_input

    read = list(inputs)
    for path in read:
        identity = _regular(_STDIN if os.fspath(path) == "-" else path)
        number = None if identity is None else streams.get(identity)
        if number is not None:
            spare_inputs(read)
            raise is_input(f"{_NAMES[number]}, which is {os.fspath(path)}")


def spare_inputs(named: Iterable[str | os.PathLike[str]]) -> None:
    """Let stdout tell what goes wrong where stderr is one of some files; nobody, where stdout is one of them too."""
    told = _regular(_STDERR)
    if told is None:
        return
    known = {_regular(_STDIN if os.fspath(path) == "-" else path) for path in named}
    if told in known:
        instead = os.open(os.devnull, os.O_WRONLY) if _regular(_STDOUT) in known - {None} else _STDOUT
        os.dup2(instead, _STDERR)


def _regular(file: str | os.PathLike[str] | int) -> tuple[int, int] | None:
    from nvscope.whole_files import identity_of

    return identity_of(file)


def _let_wait(name: str) -> None:
    """Let a stream wait for its reader: where whoever started the program made it not to, output would be cut."""
    with contextlib.suppress(AttributeError, OSError, ValueError):
        descriptor = getattr(sys, name).fileno()
        if not os.get_blocking(descriptor):
            os.set_blocking(descriptor, True)


def _stdout() -> io.TextIOWrapper:
    """Return stdout with a buffer, also where it was closed, or PYTHONUNBUFFERED took the buffer away.

    Without one, what a disk that is full takes only a part of is cut, and nobody is told.
    """
    stream: Any = sys.stdout
    if stream is None:
        closed = io.BufferedWriter(io.FileIO(_NAMES.index("stdout"), "w", closefd=False))
        return io.TextIOWrapper(closed, encoding="utf-8")
    raw = getattr(stream, "buffer", None)
    if not isinstance(raw, io.RawIOBase):
        return cast("io.TextIOWrapper", stream)
    _KEPT.append(stream)
    return io.TextIOWrapper(
        io.BufferedWriter(raw), encoding=stream.encoding, errors=stream.errors, line_buffering=True
    )  # fmt: skip


class _Forgiving(io.FileIO):
    """A file to which nothing is written where it cannot be: what is said on stderr decides no exit code."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return len(data)


def _stderr_that_never_fails() -> io.TextIOWrapper:
    stream: Any = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # to the end of the program
    try:
        raw = _Forgiving(stream.fileno(), "w", closefd=False)
    except (OSError, ValueError):
        return cast("io.TextIOWrapper", stream)
    # Forgotten, it would close the descriptor, which the next file that is opened would get.
    _KEPT.append(stream)
    return io.TextIOWrapper(
        io.BufferedWriter(raw), encoding=stream.encoding, errors="backslashreplace", line_buffering=True
    )
