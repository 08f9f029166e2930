"""Passwords that are in captures: hidden, unless somebody asks for them."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.terminal import echo

SecretsOption = Annotated[
    bool,
    typer.Option(
        "--show-secrets", help="Show passwords of web visualization, and STRINGs without a name, which are hidden else."
    ),
]


def warn_of_secrets(*, shown: bool) -> None:
    """Say that passwords are shown, where they are."""
    if shown:
        echo("nvscope: passwords are shown: whoever sees this output has them.", err=True)


def tell_of_hidden(values: int, *, verb: str = "shows") -> None:
    """Say how many values are hidden, if any."""
    if values:
        from nvscope.units import count_of

        is_one = values == 1
        told = f"{count_of(values, 'value')} {'is' if is_one else 'are'} hidden that may be a password"
        echo(f"nvscope: {told}; --show-secrets {verb} {'it' if is_one else 'them'}.", err=True)
