"""``nvscope report``: lists, counters and findings of captures."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.definitions import GvlOption
from nvscope.cli.sources import (
    DecodeOption,
    ReadOption,
    SourcesArgument,
    chosen,
    duration_ns,
    port_rules,
    tell_of_losses,
)
from nvscope.cli.terminal import ColourOption, colour_wanted, width
from nvscope.errors import ExitCode, UsageError


def report(
    sources: SourcesArgument = None,
    read: ReadOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON (nvscope.report/1).")] = False,
    as_markdown: Annotated[bool, typer.Option("--md", help="Print the report as Markdown.")] = False,
    details: Annotated[
        bool, typer.Option("-v", "--details", help="Show the diagnosis structure and the streams of every list.")
    ] = False,
    gvl: GvlOption = None,
    decode: DecodeOption = None,
    timeout: Annotated[
        str, typer.Option("--ack-timeout", metavar="DURATION", help="How long an answer may take.")
    ] = "1s",
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Report the lists of a capture: who sends them, what was lost or not answered, and what to check next.

    Exits with 3 where a capture could not be read to its end.
    """
    paths = chosen(sources, read)
    ports = port_rules(decode)
    timeout_ns = duration_ns("--ack-timeout", timeout)
    if as_json and as_markdown:
        raise UsageError("--json and --md exclude each other", next_step="leave one of them out")

    from nvscope.capture.open import open_source
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.cli.progress import ProgressBar
    from nvscope.engine import track
    from nvscope.findings.judge import judge
    from nvscope.tracker.summary import summarize
    from nvscope.view.document import report_document

    definition = values = None
    if gvl:
        from nvscope.definition.layouts import Layouts
        from nvscope.definition.load import load_definitions
        from nvscope.tracker.values import Values

        definition = load_definitions(gvl)
        values = Values(Layouts(definition))
    keep_freed_memory()
    source = open_source(paths)
    with ProgressBar(source, quiet=quiet) as progress:
        state = track(source, ports=ports, timeout_ns=timeout_ns, values=values, progress=progress)
    summary = summarize(state)
    findings = judge(state, source.infos, summary=summary, definition=definition)
    document = report_document(state, summary, findings, source.infos, definition)
    shown = colour_wanted(colour)
    if as_json:
        from nvscope.report import json

        text = json.render(document)
    elif as_markdown:
        from nvscope.report import markdown

        text = markdown.render(document, utc=utc)
    else:
        from nvscope.report import text as face

        text = face.render(document, colour=shown, width=width(), utc=utc, details=details)
    typer.echo(text, nl=not text.endswith("\n"), color=shown)
    if state.fragments:
        typer.echo(f"nvscope: {state.fragments} IP fragments were counted but not put together.", err=True)
    if tell_of_losses(source.infos):
        raise typer.Exit(ExitCode.DATA_LOSS)
