"""A process that has imported the program, and forks for each run that ``tests.program`` asks it for."""

from __future__ import annotations

import atexit
import gc
import importlib
import json
import os
import pkgutil
import runpy
import socket
import struct
import sys
import threading
import time
import traceback
from typing import Any, NoReturn, TextIO

import nvscope
from nvscope.definition.declarations import parse_declarations
from nvscope.definition.source import Source
from nvscope.expression.syntax import parse

_STREAMS = 3
_MOST_AT_ONCE = 1 << 16
_SUCCESS, _FAILURE, _NOT_FLUSHED = 0, 1, 120  # the exit codes of Python itself
# Whoever imports these imports polars, which starts threads: of threads, nothing is left after a fork but their locks.
_NOT_BEFORE_A_FORK = ("nvscope.export", "nvscope.notebook", "nvscope.__main__")
# What many runs would each import for themselves, as they come to it.
_LATE = ("numpy.ma", "numpy.random")


def import_program() -> None:
    for module in pkgutil.walk_packages(nvscope.__path__, "nvscope."):
        if not module.name.startswith(_NOT_BEFORE_A_FORK):
            importlib.import_module(module.name)
    for name in _LATE:
        importlib.import_module(name)
    assert "polars" not in sys.modules, "a module imports polars that is not kept out of the server"
    _load_grammars()
    gc.freeze()  # what is there now is not to be copied by looking through it


def _load_grammars() -> None:
    """Have the parsers made, which are the same for all texts, and take longer than most of what is parsed."""
    parse_declarations(Source("a.gvl", "VAR_GLOBAL a : INT; END_VAR"))
    parse("nv.index == 1")


def serve(channel: socket.socket) -> None:
    """Fork for each request, and answer with its exit code; return in the forked process."""
    while True:
        message, streams, _, _ = socket.recv_fds(channel, _MOST_AT_ONCE, _STREAMS)
        if not message:
            sys.exit()
        while not message.endswith(b"\n"):
            message += channel.recv(_MOST_AT_ONCE)
        child = os.fork()
        if child == 0:
            channel.close()
            become(json.loads(message), streams)
            return
        for stream in streams:
            os.close(stream)
        _, status = os.waitpid(child, 0)
        channel.sendall(struct.pack("!i", os.waitstatus_to_exitcode(status)))


def become(request: dict[str, Any], streams: list[int]) -> None:
    """Give this process what a started one has: streams, environment, working directory, and words."""
    for place, stream in enumerate(streams):
        os.dup2(stream, place)
        os.close(stream)
    coding, _, errors = request["environment"].get("PYTHONIOENCODING", "utf-8").partition(":")
    sys.stdin = open(0, encoding=coding, errors=errors or None, closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding=coding, errors=errors or None, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding=coding, errors="backslashreplace", closefd=False)  # noqa: SIM115
    os.environ.clear()
    os.environ.update(request["environment"])
    time.tzset()
    os.chdir(request["cwd"])
    sys.argv[1:] = request["words"]


def run_program() -> NoReturn:
    """Run the program and end as Python does, but for taking all modules apart, which takes longer than most runs."""
    code = _SUCCESS
    try:
        runpy.run_module("nvscope", run_name="__main__", alter_sys=True)
    except SystemExit as left:
        code = _code_of(left)
    except BaseException:
        traceback.print_exc()
        code = _FAILURE
    # In the order of Py_FinalizeEx: first whoever is still at work, then what was to be done at the end.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    os._exit(code if _flushed(sys.stdout) and _flushed(sys.stderr) else _NOT_FLUSHED)


def _code_of(left: SystemExit) -> int:
    if left.code is None or isinstance(left.code, int):
        return (left.code or _SUCCESS) & 0xFF
    print(left.code, file=sys.stderr)
    return _FAILURE


def _flushed(stream: TextIO | None) -> bool:
    """Return whether what was written to a stream is out; one that is closed or None holds nothing back."""
    try:
        if stream is not None and not stream.closed:
            stream.flush()
    except (OSError, ValueError):
        traceback.print_exc()
        return False
    return True


if __name__ == "__main__":
    import_program()
    serve(socket.socket(fileno=int(sys.argv[1])))
    run_program()
