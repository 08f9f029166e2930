"""A process that has imported the program, and forks for each run that ``tests.program`` asks it for."""

from __future__ import annotations

import gc
import importlib
import json
import os
import pkgutil
import runpy
import socket
import struct
import sys
import time
from typing import Any

import nvscope

_STREAMS = 3
_MOST_AT_ONCE = 1 << 16
# Whoever imports these imports polars, which starts threads: of threads, nothing is left after a fork but their locks.
_NOT_BEFORE_A_FORK = ("nvscope.export", "nvscope.notebook", "nvscope.__main__")


def import_program() -> None:
    for module in pkgutil.walk_packages(nvscope.__path__, "nvscope."):
        if not module.name.startswith(_NOT_BEFORE_A_FORK):
            importlib.import_module(module.name)
    assert "polars" not in sys.modules, "a module imports polars that is not kept out of the server"
    gc.freeze()  # what is there now is not to be copied by looking through it


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


if __name__ == "__main__":
    import_program()
    serve(socket.socket(fileno=int(sys.argv[1])))
    runpy.run_module("nvscope", run_name="__main__", alter_sys=True)
