"""The terminal: what it can do, what it was asked to do, and what is printed on it."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import typer

Colour = Literal["auto", "always", "never"]
ColourOption = Annotated[Colour, typer.Option("--color", help="Colours: on a terminal only, always, or never.")]


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

        text = json.render(document)
    else:
        text = render(document)
    typer.echo(text, nl=not text.endswith("\n"), color=colour)
