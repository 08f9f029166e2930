"""What the terminal can do, and what it was asked to do."""

from __future__ import annotations

import os
import shutil
import sys
from typing import Annotated, Literal

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
