"""The program run within this process: words in; exit code, stdout and stderr out, for a third of what a fork takes.

For tests that are about what is said and what is written to files. What one run leaves in memory the next one finds:
that a run begins and ends as a process does is for ``tests.program`` to test. What goes by descriptors, stdin and
stdout under the name ``-``, is run there anyway, and so is what looks at this machine: it gives up privileges.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import chdir, contextmanager
from pathlib import Path
from typing import NoReturn

from nvscope.cli import privileges
from nvscope.cli.main import main
from tests import program


def run(
    *words: str | Path, cwd: Path | None = None, stdin: bytes = b"", environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[bytes]:
    """Run ``nvscope`` with these words; ``environment`` is what is to differ; a variable that is '' is not there."""
    asked = [str(word) for word in words]
    if stdin or asked[:1] == ["doctor"] or any(word == "-" or word.startswith("-.") for word in asked):
        return program.run(*asked, cwd=cwd, stdin=stdin, environment=environment)
    with chdir(cwd or Path.cwd()), _environment(environment or {}), _privileges(), _streams(asked) as (out, err):
        try:
            main()
        except SystemExit as end:
            code = int(end.code) if isinstance(end.code, int) else 1
    return subprocess.CompletedProcess([*program.COMMAND, *asked], code, out.getvalue(), err.getvalue())


def run_text(
    *words: str | Path, cwd: Path | None = None, stdin: bytes = b"", environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run ``nvscope`` and return what it wrote as text, with the line ends of this system as line feeds."""
    return program.as_text(run(*words, cwd=cwd, stdin=stdin, environment=environment))


@contextmanager
def _privileges() -> Iterator[None]:
    """See to it that those of this process are not given up, which no test behind this one could take back."""
    before = privileges.drop_privileges
    privileges.drop_privileges = _refuse
    try:
        yield
    finally:
        privileges.drop_privileges = before


def _refuse() -> NoReturn:
    raise AssertionError("a run that opens an interface gives up privileges: have it in a process of its own")


@contextmanager
def _environment(others: Mapping[str, str]) -> Iterator[None]:
    before = dict(os.environ)
    try:
        _become(program.environment_with(others))
        yield
    finally:
        _become(before)


def _become(environment: Mapping[str, str]) -> None:
    os.environ.clear()
    os.environ.update(environment)
    if sys.platform != "win32":
        time.tzset()


@contextmanager
def _streams(words: list[str]) -> Iterator[tuple[io.BytesIO, io.BytesIO]]:
    """Let the program find its words, and streams that keep what it writes."""
    before = sys.argv, sys.stdin, sys.stdout, sys.stderr
    out, err = io.BytesIO(), io.BytesIO()
    sys.argv = ["nvscope", *words]
    sys.stdin = io.TextIOWrapper(io.BytesIO(), "utf-8")
    sys.stdout, sys.stderr = io.TextIOWrapper(out, "utf-8"), io.TextIOWrapper(err, "utf-8")
    try:
        yield out, err
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
            # What closes the wrapper must not close what is read afterwards.
            stream.detach()
        sys.argv, sys.stdin, sys.stdout, sys.stderr = before
