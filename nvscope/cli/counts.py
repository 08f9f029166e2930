"""Numbers of things on the command line, as a person writes them."""

from __future__ import annotations

import typer


def at_least_one(text: str | int) -> int:
    """Return the whole number, 1 or more, that an option is given; BadParameter for anything else."""
    try:
        number = int(text)
    except ValueError:
        raise typer.BadParameter(f"'{text}' is no whole number; expected 1 or more") from None
    if number < 1:
        raise typer.BadParameter(f"{number} is too few; expected 1 or more")
    return number
