"""The program run within this process, as a person or a script runs it: words in, exit code and what it wrote out."""

from __future__ import annotations

import io
import json
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from nvscope.cli.main import main
from nvscope.errors import ExitCode
from tests.schemas.validation import mistakes_in

SHOWN_WIDTH = 80

_PLACE = re.compile(r'  File "([^"]+)", line (\d+)')
_KIND = re.compile(r"([A-Za-z_.]*(?:Error|Exception)\b)")


@dataclass(frozen=True)
class Ran:
    """One run: its words, its exit code, and what it wrote."""

    words: tuple[str, ...]
    code: int
    out: str
    err: str

    def document(self) -> Any:
        """What was written, as JSON: strict, so without NaN and infinity, and valid by the schema that it names."""
        found = json.loads(self.out, parse_constant=_no_constant)
        if isinstance(found, dict) and "schema" in found:
            assert mistakes_in(found) == [], self.words
        return found

    def records(self) -> list[dict[str, Any]]:
        """What was written, as one JSON object a line."""
        return [json.loads(line, parse_constant=_no_constant) for line in self.out.splitlines()]


class ProgramBug(AssertionError):  # named as the program names it
    """The program says itself that this is a bug of its own: the ``kind`` of error, the ``place`` in its sources."""

    def __init__(self, ran: Ran) -> None:
        super().__init__(f"{ran.words}\n{ran.err[-3000:]}")
        lines = ran.err.splitlines()
        places = [match for line in lines if (match := _PLACE.match(line)) and "nvscope" in match[1]]
        self.place = f"{places[-1][1]}:{places[-1][2]}" if places else ""
        self.kind = next((match[1] for line in reversed(lines) if (match := _KIND.match(line))), "")


def run(*words: str, width: int = SHOWN_WIDTH) -> Ran:
    """Run ``nvscope`` with these words; ProgramBug where it breaks off."""
    with _streams(words, width) as (out, err):
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
    ran = Ran(words, code, out.getvalue().decode("utf-8"), err.getvalue().decode("utf-8"))
    if code == ExitCode.BUG or "Traceback" in ran.err:
        raise ProgramBug(ran)
    return ran


@contextmanager
def _streams(words: tuple[str, ...], width: int) -> Iterator[tuple[io.BytesIO, io.BytesIO]]:
    """Let the program find its words, its width, and streams that keep what it writes."""
    before = sys.argv, sys.stdout, sys.stderr, os.environ.get("COLUMNS")
    out, err = io.BytesIO(), io.BytesIO()
    sys.argv = ["nvscope", *words]
    os.environ["COLUMNS"] = str(width)
    sys.stdout, sys.stderr = io.TextIOWrapper(out, "utf-8"), io.TextIOWrapper(err, "utf-8")
    try:
        yield out, err
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        # What closes the wrappers must not close what is read afterwards.
        sys.stdout.detach()
        sys.stderr.detach()
        sys.argv, sys.stdout, sys.stderr, columns = before
        if columns is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = columns


def _no_constant(name: str) -> Any:
    raise AssertionError(f"{name} is no JSON")
