"""``nvscope explain``: what a cause or a finding means, or what a figure or a column tells."""

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
            help="A cause, a finding, a figure or a column: second-sender, NV301, no-acknowledgement, list.jitter, "
            "status.",
            autocompletion=codes,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The same as JSON (nvscope.explain/1).")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Tell what a cause is, by what it is told, and what to do; what a finding means, and its usual causes; or what a
    figure or a column of reports tells. Without CODE, list all causes and findings."""
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
