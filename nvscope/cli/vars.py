"""``nvscope vars``: the variables of a capture, by name."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.definitions import GvlOption
from nvscope.cli.sources import DecodeOption, ReadOption, SourcesArgument, chosen, port_rules, tell_of_losses
from nvscope.cli.terminal import ColourOption, colour_wanted, width
from nvscope.errors import ExitCode, UsageError


def variables(
    sources: SourcesArgument = None,
    read: ReadOption = None,
    gvl: GvlOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the variables as JSON (nvscope.vars/1).")] = False,
    decode: DecodeOption = None,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Show the variables of a capture: last value, when and how often it changed, and its bounds.

    Their names come from the definition files that the PLC project exports. Exits with 3 where a capture could not be
    read to its end.
    """
    paths = chosen(sources, read)
    ports = port_rules(decode)
    if not gvl:
        raise UsageError("no definition is given", next_step="name the exported list and its types with --gvl FILE")

    from nvscope.capture.open import open_source
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.cli.progress import ProgressBar
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.load import load_definitions
    from nvscope.engine import track
    from nvscope.tracker.values import Values
    from nvscope.view.escape import visible
    from nvscope.view.variables import variables_document

    values = Values(Layouts(load_definitions(gvl)))
    keep_freed_memory()
    source = open_source(paths)
    with ProgressBar(source, quiet=quiet) as progress:
        state = track(source, ports=ports, values=values, progress=progress)
    document = variables_document(state, values)
    if as_json:
        from nvscope.report import json

        text = json.render(document)
    else:
        from nvscope.report import variables as face

        text = face.render(document, colour=colour_wanted(colour), width=width(), utc=utc)
    typer.echo(text, nl=not text.endswith("\n"), color=colour_wanted(colour))
    for entry in values.layouts.left_out:
        typer.echo(f"nvscope: {visible(entry.name)} was not decoded: `nvscope gvl layout` shows why.", err=True)
    if tell_of_losses(source.infos):
        raise typer.Exit(ExitCode.DATA_LOSS)
