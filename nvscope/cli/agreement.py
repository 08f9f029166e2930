"""Whether a value may be written: a person is asked who sees what it is now, or has said so from the beginning."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from nvscope.cli.terminal import echo
from nvscope.errors import UsageError


def refuse_without_terminal() -> None:
    """Raise UsageError where nobody can be asked."""
    if sys.stdin is None or not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(
            "nobody can be asked: there is no terminal, and nothing is written without being asked",
            next_step="--yes writes without asking",
        )


class Agreed:
    """Tells whether a value may be written, given what is known before it is; ``said_yes`` is what was told last.

    ``question`` makes of that what a person is asked.
    """

    def __init__(self, question: Callable[[dict[str, Any]], str], *, asks: bool) -> None:
        self._question, self._asks = question, asks
        self.said_yes = False

    def __call__(self, before: dict[str, Any]) -> bool:
        self.said_yes = not self._asks or self._answer(before).strip().lower() in ("y", "yes")
        return self.said_yes

    def _answer(self, before: dict[str, Any]) -> str:
        try:
            echo(f"{self._question(before)} [y/N]", err=True, nl=False)
            echo(" ", err=True, nl=False)  # apart: it would be lost where a line ends
            answer = sys.stdin.readline()
        except KeyboardInterrupt:
            echo("\nnvscope: nothing was written.", err=True)
            raise
        if not answer.endswith("\n"):  # Ctrl-D: what is told next would stand behind the question
            echo("", err=True)
        return answer
