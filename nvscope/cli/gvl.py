"""``nvscope gvl``: what definition files say."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer
from msgspec.structs import replace

from nvscope.cli.definitions import ProjectOption, project_of, tell_of_flaws
from nvscope.cli.help import Command, Group
from nvscope.cli.streams import refuse_streams_onto
from nvscope.cli.terminal import ColourOption, WideOption, colour_wanted, tables_are_wide, tell, width
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.definition.project import Project

app = typer.Typer(
    help="Look at definition files: byte maps of the telegrams, mistakes, and what differs between two sides.",
    no_args_is_help=True,
    rich_markup_mode=None,
    cls=Group,
)

FilesArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[FILE...]",
        help="Exported lists, and the files with the types they use; without any, those that the project names.",
        show_default=False,
    ),
]


@app.callback()
def _verbs() -> None:
    """Look at definition files: byte maps of the telegrams, mistakes, and what differs between two sides."""


def _plant(files: Sequence[str] | None, project: str | None, *, quiet: bool = False) -> Project:
    """Return what the files or the project define, without lists of which only the project's settings are known.

    What is wrong with the files is told, if not ``quiet``.
    """
    plant = project_of(project, files)
    if not files and not plant.files:
        raise UsageError(
            "no definition is given",
            next_step="name the exported list and its types, or write them into nvscope.toml: definitions = [...]",
        )
    if not quiet:
        tell_of_flaws(plant.definition)
    described = tuple(entry for entry in plant.definition.lists if entry.position.file in plant.files)
    return replace(plant, definition=replace(plant.definition, lists=described))


@app.command(cls=Command)
def layout(
    files: FilesArgument = None,
    project: ProjectOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the byte maps as JSON (nvscope.layout/1).")] = False,
    wide: WideOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Print what lies where in each telegram of each list."""
    from nvscope.report import layout as face
    from nvscope.view.documents.layout import layout_document

    document = layout_document(_plant(files, project).definition)
    shown = colour_wanted(colour)
    render = partial(face.render, colour=shown, width=width(), wide=tables_are_wide(wide))
    tell(document, render, as_json=as_json, colour=shown)


@app.command(cls=Command)
def lint(
    files: FilesArgument = None,
    project: ProjectOption = None,
    rules: Annotated[bool, typer.Option("--rules", help="Print all rules and what they are about.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the mistakes as JSON (nvscope.lint/1).")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Find what will not work on the wire, before it is sent.

    Exits with 1 where there are errors or warnings, with 0 where there are none or only notes.
    """
    from nvscope.report import lint as face
    from nvscope.view.documents.lint import lint_document, rules_document

    if rules:
        document = rules_document()
    else:
        from nvscope.definition.lint import lint as mistakes_in
        from nvscope.definition.load import read_definitions
        from nvscope.definition.wanted_files import DefinitionFile

        plant = _plant(files, project, quiet=True)
        read = read_definitions([DefinitionFile(file, file) for file in plant.files])
        mistakes = mistakes_in(list(read.files.values()), plant.definition)
        document = lint_document(list(dict.fromkeys(plant.files)), len(plant.definition.lists), mistakes)
    render = face.render_rules if rules else face.render
    shown = colour_wanted(colour)
    tell(document, partial(render, colour=shown, width=width()), as_json=as_json, colour=shown)
    if any(mistake["severity"] != "note" for mistake in document.get("mistakes", ())):
        raise typer.Exit(ExitCode.ASSERTION_FAILED)


def _types_option(name: str, whose: str) -> Any:
    return typer.Option(
        name, metavar="FILE", help=f"File with types and constants {whose}; may be repeated.", show_default=False
    )


@app.command(cls=Command)
def diff(
    a: Annotated[str, typer.Argument(metavar="A", help="Definition file of the sender.")],
    b: Annotated[str, typer.Argument(metavar="B", help="Definition file of the reader.")],
    types: Annotated[list[str] | None, _types_option("--types", "of both sides")] = None,
    a_types: Annotated[list[str] | None, _types_option("--a-types", "of A alone")] = None,
    b_types: Annotated[list[str] | None, _types_option("--b-types", "of B alone")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the comparison as JSON (nvscope.diff/2).")] = False,
    wide: WideOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Compare two definitions, and show where A's values land in B.

    Exits with 0 where both are the same on the wire, whatever their variables are called, and with 1 where not, or
    where nobody knows, since an element has no known size.
    """
    from nvscope.definition.difference import difference
    from nvscope.definition.load import load_definitions
    from nvscope.report import difference as face
    from nvscope.view.documents.difference import difference_document

    refuse_streams_onto([a, b, *(types or ()), *(a_types or ()), *(b_types or ())])
    sides = [load_definitions([file, *(types or ()), *(own or ())]) for file, own in ((a, a_types), (b, b_types))]
    for file, side in zip((a, b), sides, strict=True):
        tell_of_flaws(side)
        if not side.lists:
            raise UsageError("no list is defined", where=file, next_step="name the exported list; types go to --types")
    document = difference_document(difference(*sides))
    shown = colour_wanted(colour)
    render = partial(face.render, colour=shown, width=width(), wide=tables_are_wide(wide))
    tell(document, render, as_json=as_json, colour=shown)
    if not document["same_on_wire"]:
        raise typer.Exit(ExitCode.ASSERTION_FAILED)
