"""The program run within this process, as a person or a script runs it: words in, exit code and what it wrote out."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Any

from nvscope.errors import ExitCode
from tests.program_here import run_text
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
    done = run_text(*words, environment={"COLUMNS": str(width)})
    ran = Ran(words, done.returncode, done.stdout, done.stderr)
    if ran.code == ExitCode.BUG or "Traceback" in ran.err:
        raise ProgramBug(ran)
    return ran


def _no_constant(name: str) -> Any:
    raise AssertionError(f"{name} is no JSON")
