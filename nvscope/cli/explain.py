"""``nvscope explain``: what a finding means."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.terminal import ColourOption, colour_wanted, width


def explain(
    code: Annotated[str | None, typer.Argument(help="A code or name: NV301, 301, no-acknowledgement.")] = None,
    colour: ColourOption = "auto",
) -> None:
    """Tell what a finding means, its usual causes, and what to do; without CODE, list all findings."""
    from nvscope.report import explain as face

    shown = colour_wanted(colour)
    if code is None:
        typer.echo(face.overview(colour=shown, width=width()), nl=False, color=shown)
    else:
        typer.echo(face.render(code, colour=shown, width=width()), nl=False, color=shown)
