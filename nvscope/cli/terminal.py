"""The terminal: what it can do, what it was asked to do, and what is printed on it."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from contextvars import ContextVar
from typing import Annotated, Any, Literal

import typer

from nvscope import units
from nvscope.cli.encodings import as_data

Colour = Literal["auto", "always", "never"]
ColourOption = Annotated[Colour, typer.Option("--color", help="Colours: on a terminal only, always, or never.")]
WideOption = Annotated[
    bool,
    typer.Option(
        "--wide", help="Tables as wide as they need, with all columns and whole names, however wide the terminal is."
    ),
]

_NARROWEST = 20
_READABLE = 100
"""Columns of prose where there is no terminal to fit it to."""


_COMMAND = re.compile(r"^(\s*):(?=:)|##(?=\[)", re.MULTILINE)
_asked_for: ContextVar[bool] = ContextVar("commands of a workflow", default=False)


def guard_workflow() -> None:
    """Let nothing that is printed from now on be taken for a command of a GitHub workflow, whoever wrote it."""
    _asked_for.set(True)


def workflow_command(line: str) -> None:
    """Print a command of a GitHub workflow."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _harmless(text: str) -> str:
    if not (_asked_for.get() or os.environ.get("GITHUB_ACTIONS") == "true"):
        return text
    return _COMMAND.sub(lambda match: "## " if match[0] == "##" else f"{match[1]}: ", text)


def echo(text: str, *, nl: bool = True, err: bool = False, color: bool | None = None) -> None:
    """Print a text to stdout, or to stderr, as their encodings have it (``nvscope.cli.encodings``).

    ``color`` says whether the text has colours, which old consoles of Windows have to be shown otherwise. On stderr, if
    it is a terminal, lines end between words.
    """
    text = _harmless(notice(text) if err else text)
    if color and sys.platform == "win32":
        typer.echo(text, nl=nl, err=err, color=True)
        return
    # Not by typer: it writes UTF-8 where it takes an encoding for wrong.
    stream = sys.stderr if err else sys.stdout
    stream.write(f"{text}\n" if nl else text)
    stream.flush()


def erase_interrupt() -> None:
    """Take away the ^C that a terminal shows where somebody ended what ran."""
    if sys.stderr.isatty():
        echo("\r\x1b[K", err=True, nl=False)


def notice(text: str) -> str:
    """Return a text for stderr with its lines broken between words where that is a terminal; elsewhere as it is.

    What cannot be broken, such as a path, stays whole: the terminal breaks it, and it can still be copied.
    """
    columns = _columns_of_stderr()
    lines = []
    for line in text.split("\n"):
        if columns is None or len(line) < columns:
            lines.append(line)
            continue
        indent = " " * (len(line) - len(line.lstrip(" ")) + 2)
        lines += textwrap.wrap(
            line, columns - 1, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )  # fmt: skip
    return "\n".join(lines)


def _columns_of_stderr() -> int | None:
    """Return the columns of the terminal that stderr is, None where it is none or does not tell."""
    try:
        if not sys.stderr.isatty():
            return None
        columns = os.get_terminal_size(sys.stderr.fileno()).columns
    except (OSError, ValueError):
        return None
    return max(columns, _NARROWEST) if columns else None


def echo_all(parts: Iterable[str], *, color: bool) -> None:
    """Print the parts of a text to stdout, which are made while they are printed."""
    if color and sys.platform == "win32":
        for part in parts:
            echo(part, nl=False, color=True)
        return
    sys.stdout.writelines(parts)
    sys.stdout.flush()


def colour_wanted(choice: Colour) -> bool:
    """Decide on colours: what was asked for, else NO_COLOR, else whether stdout is a terminal."""
    if choice != "auto":
        return choice == "always"
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def width() -> int:
    """Return the columns of the terminal, or what COLUMNS says; 100 where stdout is none.

    A pager that is narrower shows them whole: the terminal of stderr counts, up to 100.
    """
    if not os.environ.get("COLUMNS") and not sys.stdout.isatty():
        return min(os.get_terminal_size(sys.stderr.fileno()).columns, _READABLE) if sys.stderr.isatty() else _READABLE
    return shutil.get_terminal_size((_READABLE, 24)).columns


def tables_are_wide(asked: bool) -> bool:
    """Decide whether tables are as wide as they need: asked for, or in a file or pipe of which COLUMNS says nothing."""
    return asked or not (sys.stdout.isatty() or os.environ.get("COLUMNS"))


def numbers(*, as_json: bool, as_markdown: bool) -> AbstractContextManager[None]:
    """Have thousands separated where a person sees them; elsewhere a program may want to read the numbers.

    JSON and Markdown are the same wherever they go: in the sentences of the one thousands are separated, in the tables
    and sentences of the other they are not.
    """
    return units.thousands(separated=as_json or (sys.stdout.isatty() and not as_markdown))


def tell(
    document: Mapping[str, Any], render: Callable[[Mapping[str, Any]], str], *, as_json: bool, colour: bool
) -> None:
    """Print a document as JSON, or as ``render`` makes it, ending with one line break."""
    if as_json:
        from nvscope.report import json

        as_data()
        text = json.render(document)
    else:
        text = render(document)
    echo(text, nl=not text.endswith("\n"), color=colour)
