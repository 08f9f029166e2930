"""``nvscope keys``: the keys of the screen, and the names that expressions and -e know."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.definitions import GvlOption, ProjectOption, project_of, tell_of_lists
from nvscope.cli.encodings import as_data
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, width

_MIN_WIDTH = 40


def keys(
    files: Annotated[
        list[str] | None,
        typer.Argument(metavar="[DEFINITION...]", help="Definitions, as by --gvl.", show_default=False),
    ] = None,
    fields: Annotated[bool, typer.Option("--fields", help="The fields, of filters and of outputs.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="The fields for programs.")] = False,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    colour: ColourOption = "auto",
) -> None:
    """List the keys of the screen (`nvscope watch`), as the project file has them; with --fields, the fields.

    Fields are what a display filter (-Y) and -e may name; with definitions also those of the variables.
    """
    plant = project_of(project, [*(gvl or ()), *(files or ())])
    if not (fields or as_json or gvl or files):
        from nvscope.report.ansi import paint
        from nvscope.tui.actions import Keymap
        from nvscope.tui.help_page import key_lines

        keymap = Keymap(plant.keys, str(plant.path or ""))
        shown = colour_wanted(colour)
        echo(paint(key_lines(keymap, max(width(), _MIN_WIDTH)), colour=shown), nl=False, color=shown)
        return
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.report import fields as face

    inquiry = Inquiry([], plant)
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
