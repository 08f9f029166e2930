"""``nvscope explain``: what a finding means, or what a figure or a column tells."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.completion import codes
from nvscope.cli.encodings import as_data
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, width


def explain(
    code: Annotated[
        str | None,
        typer.Argument(
            help="A finding, a figure or a column: NV301, no-acknowledgement, list.jitter, status.",
            autocompletion=codes,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The same as JSON (nvscope.explain/1).")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Tell what a finding means, its usual causes, and what to do, or what a figure or a column of reports tells;
    without CODE, list all findings."""
    from nvscope.report import explain as face

    if as_json:
        from nvscope.report import json

        as_data()
        echo(json.render(face.document(code)), nl=False)
        return
    shown = colour_wanted(colour)
    if code is None:
        echo(face.overview(colour=shown, width=width()), nl=False, color=shown)
    else:
        echo(face.render(code, colour=shown, width=width()), nl=False, color=shown)
