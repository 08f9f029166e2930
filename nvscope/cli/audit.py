"""``nvscope audit``: whether a DataLogger's database can be trusted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.cli.definitions import project_of
from nvscope.cli.terminal import ColourOption, WideOption, colour_wanted, echo, numbers, tables_are_wide, tell, width
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from nvscope.datalogger.configuration import Session


def audit(
    files: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FILE.db...", show_default=False,
            help="Databases of DataLoggers, or directories of them. x.db takes its closed files x.db.0, x.db.1 … along "
            "as one series; a closed file that is named without it is audited by itself.",
        ),
    ] = None,
    config: Annotated[
        str | None,
        typer.Option(
            "--config", metavar="FILE.xml", show_default=False,
            help="The session's configuration, for the interval at which values should come, and whether it is that of "
            "the table. Without it, the interval is the median of the table.",
        ),
    ] = None,
    project: Annotated[
        str | None,
        typer.Option(
            "--project", metavar="FILE", show_default=False,
            help="Project file that says of --config which variables are taken in cycles of lists, [datalogger.tasks]. "
            "Without it, the next nvscope.toml in the working directory or above it.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="For programs (nvscope.audit/1).")] = False,
    as_markdown: Annotated[bool, typer.Option("--md", help="As Markdown, for a ticket.")] = False,
    every: Annotated[bool, typer.Option("--all", help="Show all variables.")] = False,
    wide: WideOption = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:  # fmt: skip
    """Tell whether the database of a DataLogger can be trusted: what is missing, and whether it says so.

    Reads databases of controllers and those of `datalog`, in whatever state they are, and changes nothing. Times are
    UTC. Exits with 1 where something is an error, with 4 where nothing can be read; `nvscope explain NV952` tells more
    about a finding.
    """
    if as_json and as_markdown:
        raise UsageError("--json is for programs, --md for people", next_step="leave one of them out")
    if not files:
        raise UsageError("no database is named", next_step="nvscope audit FILE.db")
    if "" in files:
        raise UsageError("the name of a database is empty", next_step="leave it out, or name a file")
    if "-" in files:
        raise UsageError(
            "- is the standard input, and a database is audited as a file, with what lies beside it",
            next_step="save it to a file, and name that",
        )
    if project is not None and config is None:
        raise UsageError(
            "--project says of a configuration which of its variables are taken in cycles of lists",
            next_step="name the configuration with --config, or leave --project out",
        )
    session = _session(config)
    # Of a task, the configuration does not say how often it runs.
    asked_ns = None if session is None or session.task else session.sampling_ns

    from nvscope.cli.read_progress import ReadProgress
    from nvscope.datalogger.audit.audit import audited
    from nvscope.datalogger.audit.document import document
    from nvscope.findings.kind import Severity

    with ReadProgress(quiet=quiet) as progress:
        found = audited(files, asked_ns, progress, None if session is None else _in_cycles(project))
    if session is not None:
        from nvscope.datalogger.audit.configured import compare

        compare(session, found)
    shown = colour_wanted(colour)
    if as_json:
        tell(document(found), str, as_json=True, colour=False)
    else:
        with numbers(as_json=False, as_markdown=as_markdown):
            if as_markdown:
                from nvscope.datalogger.audit.markdown import markdown

                echo("\n".join(markdown(found)))
            else:
                from nvscope.datalogger.audit.lines import lines
                from nvscope.report.ansi import paint

                text = paint(lines(found, width(), wide=tables_are_wide(wide), every=every), colour=shown)
                echo(text, nl=False, color=shown)
    if found.is_unreadable:
        raise typer.Exit(ExitCode.UNREADABLE)
    if found.of(Severity.ERROR):
        raise typer.Exit(ExitCode.ASSERTION_FAILED)


def _in_cycles(project: str | None) -> Callable[[str], bool] | None:
    """Return what tells which variables are taken in cycles of lists, None where the project names no task."""
    settings = project_of(project, None).datalogger
    return (lambda name: settings.task_of(name) is not None) if settings.tasks else None


def _session(config: str | None) -> Session | None:
    """Return the session of a configuration, None without one."""
    if config is None:
        return None
    from nvscope.datalogger.configuration_file import read_configuration

    found = read_configuration(config)
    for sentence in found.unknown:
        echo(sentence, err=True)
    return found.session
