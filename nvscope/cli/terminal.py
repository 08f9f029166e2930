"""The terminal: what it can do, what it was asked to do, and what is printed on it."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, Literal

import typer

from nvscope.cli.encodings import as_data

Colour = Literal["auto", "always", "never"]
ColourOption = Annotated[Colour, typer.Option("--color", help="Colours: on a terminal only, always, or never.")]


def echo(text: str, *, nl: bool = True, err: bool = False, color: bool | None = None) -> None:
    """Print a text to stdout, or to stderr, as their encodings have it (``nvscope.cli.encodings``).

    ``color`` says whether the text has colours, which old consoles of Windows have to be shown otherwise.
    """
    if color and sys.platform == "win32":
        typer.echo(text, nl=nl, err=err, color=True)
        return
    # Not by typer: it writes UTF-8 where it takes an encoding for wrong.
    stream = sys.stderr if err else sys.stdout
    stream.write(f"{text}\n" if nl else text)
    stream.flush()


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
    """Return the columns of the terminal, that of stderr where stdout goes elsewhere, 100 where there is none."""
    if not os.environ.get("COLUMNS") and not sys.stdout.isatty() and sys.stderr.isatty():
        return os.get_terminal_size(sys.stderr.fileno()).columns
    return shutil.get_terminal_size((100, 24)).columns


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
