"""``nvscope datalog config``: a configuration of a DataLogger, from lists."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.completion import lists
from nvscope.cli.definitions import GvlOption, ProjectOption, project_of, tell_of_flaws
from nvscope.cli.sources import ForceOption
from nvscope.cli.terminal import echo
from nvscope.errors import UsageError

_PREFIX = "Arp.Plc.Eclr/"
"""What names of variables of the control program begin with."""


def config(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME…]",
            help="Lists, by name, identifier or key; or variables, as --history of `nvscope vars` takes them: fSpeed, "
            "axis:stAxis, 'st*.pos'. Without any, all variables of all lists.",
            autocompletion=lists,
            show_default=False,
        ),
    ] = None,
    write: Annotated[
        str | None,
        typer.Option("-w", "--write", metavar="FILE", help="The file to write; stdout without it.", show_default=False),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="ATTRIBUTE=VALUE",
            help="An attribute of the configuration, such as samplingInterval=50ms or storeChangesOnly=true.",
            show_default=False,
        ),
    ] = None,
    prefix: Annotated[
        str, typer.Option("--prefix", metavar="TEXT", help="What names of variables begin with on the controller.")
    ] = _PREFIX,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    force: ForceOption = False,
) -> None:
    """Write the configuration of a DataLogger session for variables of lists.

    A controller reads it too, where its variables are called so.
    """
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.datalogger.column_names import next_step_of, taken_names
    from nvscope.datalogger.configuration_file import written
    from nvscope.datalogger.draft import chosen, session_of, uris
    from nvscope.whole_files import is_stdout

    plant = project_of(project, gvl)
    tell_of_flaws(plant.definition)
    layouts = Inquiry((), plant).defined_layouts()
    variables = chosen(layouts, names or ())
    session = session_of(variables, plant.definition.nominal_intervals_ns(), settings or ())
    called = uris(variables, layouts, prefix)
    taken = taken_names(called)
    if twice := next((uri for uri in called if uri.lower() in taken), None):
        raise UsageError(f"'{twice}' is what another column of the database is called", next_step=next_step_of(twice))
    text = written(session, called)
    if write is None or is_stdout(write):
        echo(text, nl=False)
        return
    if not write.strip():
        raise UsageError("the name of a file to write is empty", next_step="name one, or leave -w out")
    from nvscope.whole_files import Existing, WholeFiles

    files = WholeFiles(plant.inputs, force=force)
    try:
        files.write(write, text.encode(), Existing.KEPT)
        files.publish()
    except BaseException:
        files.discard()
        raise
