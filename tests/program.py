"""The program as a process of its own, as a person or a script runs it: words in; exit code, stdout and stderr out.

Each run is forked from a process that has imported the program, has loaded its grammars and has run nothing
(``tests.program_server``), so that it begins as clean as ``python -m nvscope``, without the time in which that imports
what it needs. What the start of a program is about is tested with ``COMMAND``: imports, interrupts, terminals, limits,
and pipes that somebody closes. The order of sets is the same in all runs that one server forks: that nothing depends on
it is tested with several.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

COMMAND = (sys.executable, "-m", "nvscope")

_ROOT = Path(__file__).parents[1]
_LONGEST_S = 60
_ANSWER = struct.Struct("!i")


def run(
    *words: str | Path,
    cwd: Path | None = None,
    stdin: bytes = b"",
    environment: Mapping[str, str] | None = None,
    encoding: str = "utf-8",
    sets: str = "",
) -> subprocess.CompletedProcess[bytes]:
    """Run ``nvscope`` with these words; ``environment`` is what is to differ from that of the tests.

    ``sets`` is the PYTHONHASHSEED of another server, in whose runs sets have another order.
    """
    asked = [str(word) for word in words]
    others = {"PYTHONIOENCODING": encoding, "PYTHONHASHSEED": sets or os.environ.get("PYTHONHASHSEED", "")}
    request = _request(asked, cwd, {**others, **(environment or {})})
    if not hasattr(os, "fork"):
        return subprocess.run(
            [*COMMAND, *asked], input=stdin, capture_output=True, check=False, timeout=_LONGEST_S,
            cwd=request["cwd"], env=request["environment"],
        )  # fmt: skip
    (their_in, our_in), (our_out, their_out), (our_err, their_err) = os.pipe(), os.pipe(), os.pipe()
    # A pipe holds little: to serve one after the other would be to wait for each other.
    with ThreadPoolExecutor(3) as pipes:
        pipes.submit(_write, our_in, stdin)
        out, err = pipes.submit(_read, our_out), pipes.submit(_read, our_err)
        try:
            code = _server(sets).run(json.dumps(request), (their_in, their_out, their_err))
        finally:
            for end in (their_in, their_out, their_err):
                os.close(end)
        return subprocess.CompletedProcess([*COMMAND, *asked], code, out.result(), err.result())


def run_on_terminal(
    *words: str, columns: int, encoding: str = "utf-8", stream: str = "stdout", environment: Mapping[str, str]
) -> str:  # fmt: skip
    """Return what ``nvscope`` writes to a stream that is a terminal of so many columns; nobody reads the other one."""
    import fcntl  # noqa: PLC0415  # none of them is on Windows
    import pty  # noqa: PLC0415
    import termios  # noqa: PLC0415

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    nowhere = os.open(os.devnull, os.O_RDWR)
    out, err = (theirs if name == stream else nowhere for name in ("stdout", "stderr"))
    request = _request(words, None, {"PYTHONIOENCODING": encoding, **environment})
    with ThreadPoolExecutor(1) as terminal:
        told = terminal.submit(_read_terminal, ours)
        try:
            _server("").run(json.dumps(request), (nowhere, out, err))
        finally:
            for end in (theirs, nowhere):
                os.close(end)
        return told.result().decode(encoding).replace("\r\n", "\n")


def _request(words: Sequence[str], cwd: Path | None, environment: Mapping[str, str]) -> dict[str, Any]:
    """Return what the server is asked to run."""
    return {"words": list(words), "cwd": str(cwd or Path.cwd()), "environment": environment_with(environment)}


def environment_with(others: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of the tests with some variables that differ; one that is '' is not there."""
    return {name: value for name, value in {**os.environ, **others}.items() if value}


def run_text(
    *words: str | Path, cwd: Path | None = None, stdin: bytes = b"", environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run ``nvscope`` and return what it wrote as text, with the line ends of this system as line feeds."""
    return as_text(run(*words, cwd=cwd, stdin=stdin, environment=environment))


def as_text(done: subprocess.CompletedProcess[bytes]) -> subprocess.CompletedProcess[str]:
    out, err = (wrote.decode("utf-8").replace(os.linesep, "\n") for wrote in (done.stdout, done.stderr))
    return subprocess.CompletedProcess(done.args, done.returncode, out, err)


def _read_terminal(terminal: int) -> bytes:
    told = b""
    with contextlib.suppress(OSError):  # which is how a terminal ends
        while part := os.read(terminal, 65_536):
            told += part
    os.close(terminal)
    return told


def _write(pipe: int, content: bytes) -> None:
    with open(pipe, "wb") as file:
        try:
            file.write(content)
            file.flush()
        except BrokenPipeError:  # the program needed no more of it
            return


def _read(pipe: int) -> bytes:
    with open(pipe, "rb") as file:
        return file.read()


class _Server:
    """The process that is forked for each run, and the channel to it."""

    def __init__(self, sets: str) -> None:
        self._channel, theirs = socket.socketpair()
        self._channel.settimeout(_LONGEST_S)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.program_server", str(theirs.fileno())],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, start_new_session=True,
                cwd=_ROOT, env={**os.environ, "PYTHONUTF8": "1"} | ({"PYTHONHASHSEED": sets} if sets else {}),
            )  # fmt: skip
        atexit.register(self.end)

    def run(self, request: str, streams: tuple[int, int, int]) -> int:
        """Have a request run with these streams; return its exit code."""
        message = request.encode() + b"\n"
        try:
            sent = socket.send_fds(self._channel, [message], streams)
            self._channel.sendall(message[sent:])
            answer = self._channel.recv(_ANSWER.size, socket.MSG_WAITALL)
            return int(_ANSWER.unpack(answer)[0])
        except (OSError, struct.error):
            # It takes too long, or the server broke off: whatever is run next must not find the answer to this.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self.end()
            _server.cache_clear()
            raise

    def end(self) -> None:
        self._channel.close()
        self._process.wait()
        atexit.unregister(self.end)


@cache
def _server(sets: str) -> _Server:
    return _Server(sets)
