"""``nvscope schema``: what the documents for programs look like, as JSON Schema."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.completion import documents
from nvscope.cli.terminal import ColourOption, colour_wanted, width

_MIN_WIDTH = 40


def schema(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A document: report, vars, or as it says itself, nvscope.report/2.", autocompletion=documents
        ),
    ] = None,
    colour: ColourOption = "auto",
) -> None:
    """Print the JSON Schema (draft 2020-12) of a document that --json writes; without NAME, list all documents."""
    from nvscope.schemas.schema_files import schema_names, schema_subject, schema_text

    if name is not None:
        typer.echo(schema_text(name), nl=False)
        return
    from nvscope.report.ansi import paint
    from nvscope.view.lines.table import GAP, Cell, Tone, wrap

    names = schema_names()
    indent = max(map(len, names)) + GAP
    room = max(width(), _MIN_WIDTH)
    lines = [
        line
        for told in names
        for line in wrap([Cell(told.ljust(indent), Tone.STRONG), Cell(schema_subject(told))], room, hanging=indent)
    ]
    shown = colour_wanted(colour)
    typer.echo(paint(lines, colour=shown), nl=False, color=shown)
