"""``nvscope gvl``: what definition files say."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.terminal import ColourOption, colour_wanted, width

app = typer.Typer(
    help="Look at definition files: byte maps of the telegrams.", no_args_is_help=True, rich_markup_mode=None
)

FilesArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="FILE...", help="Exported lists, and the files with the types they use.", show_default=False
    ),
]


@app.callback()
def _verbs() -> None:
    """Look at definition files: byte maps of the telegrams."""


@app.command()
def layout(
    files: FilesArgument,
    as_json: Annotated[bool, typer.Option("--json", help="Print the byte maps as JSON (nvscope.layout/1).")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Print what lies where in each telegram of each list."""
    from nvscope.definition.load import load_definitions
    from nvscope.view.layout import layout_document

    document = layout_document(load_definitions(files))
    if as_json:
        from nvscope.report import json

        text = json.render(document)
    else:
        from nvscope.report import layout as face

        text = face.render(document, colour=colour_wanted(colour), width=width())
    typer.echo(text, nl=not text.endswith("\n"), color=colour_wanted(colour))
