"""Commands one after the other, each forked from one process that has imported the program: on a host of our own.

``python -m tests.cli.each_forked '["visu read …", …]'`` prints exit code, stdout and stderr of each as JSON. Behind
``--alone``, whatever looks a name up, connects or sends ends with exit code 99.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
import tempfile
from typing import Any, NoReturn

_MODULES = (
    "nvscope.cli.main", "nvscope.cli.visu", "nvscope.plc.visu.client", "nvscope.plc.visu.link", "nvscope.report.visu",
    "nvscope.definition.project", "nvscope.cli.live", "dissectors.webvisu",
)  # fmt: skip
_NETWORK = ("socket.connect", "socket.sendto", "socket.sendmsg", "socket.getaddrinfo", "socket.gethostbyname")
_NUMBERS = re.compile(r"[0-9.]+")
CAUGHT = 99


def _run(words: list[str], *, alone: bool) -> NoReturn:
    def watched(event: str, about: Any) -> None:
        # Of an address, what makes it one of sockets asks nobody.
        if event in _NETWORK and not (event == "socket.getaddrinfo" and _NUMBERS.fullmatch(str(about[0]))):
            os._exit(CAUGHT)

    if alone:
        sys.addaudithook(watched)
    sys.argv[1:] = words
    code = 0
    try:
        importlib.import_module("nvscope.cli.main").main()
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def main() -> None:
    for module in _MODULES:
        importlib.import_module(module)
    *options, commands = sys.argv[1:]
    told: list[tuple[int, str, str]] = []
    for words in json.loads(commands):
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
            child = os.fork()
            if not child:
                os.dup2(out.fileno(), 1)
                os.dup2(err.fileno(), 2)
                _run(words.split(), alone="--alone" in options)
            _, status = os.waitpid(child, 0)
            both = []
            for file in (out, err):
                file.seek(0)
                both.append(file.read())
            told.append((os.waitstatus_to_exitcode(status), *both))
    print(json.dumps(told))


if __name__ == "__main__":
    main()
