"""``nvscope keys``: the names that expressions and -e know."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.definitions import GvlOption, ProjectOption, project_of, tell_of_lists
from nvscope.cli.encodings import as_data
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, width


def keys(
    files: Annotated[
        list[str] | None,
        typer.Argument(metavar="[DEFINITION...]", help="Definitions, as by --gvl.", show_default=False),
    ] = None,
    fields: Annotated[bool, typer.Option("--fields", help="The fields alone, once there are key bindings.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="The same for programs.")] = False,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    colour: ColourOption = "auto",
) -> None:
    """List the fields that a display filter (-Y) and -e may name; with definitions also those of the variables."""
    if not fields:
        echo("nvscope: there is no live screen yet, and so there are no key bindings.", err=True)
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.report import fields as face

    inquiry = Inquiry([], project_of(project, [*(gvl or ()), *(files or ())]))
    known = inquiry.fields
    if as_json:
        from nvscope.report import json

        as_data()
        echo(json.render(face.document(known)), nl=False)
    else:
        shown = colour_wanted(colour)
        echo(face.render(known, colour=shown, width=width()), nl=False, color=shown)
    if inquiry.project.files:
        tell_of_lists(inquiry)
