"""``nvscope vars``: the variables of a capture, by name."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nvscope.cli.completion import lists
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import (
    GvlOption,
    NoNamesOption,
    ProjectOption,
    flaws_told_first,
    tell_of_lists,
    tell_of_missing,
)
from nvscope.cli.drafted_lists import propose
from nvscope.cli.encodings import as_data
from nvscope.cli.live import LiveOptions, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.read_notes import hidden_in, tell_of_read_ones
from nvscope.cli.secrets import SecretsOption, warn_of_secrets
from nvscope.cli.sources import (
    ChannelMapOption,
    FilterOption,
    ForceOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    tell_of_channels,
    tell_of_losses,
)
from nvscope.cli.terminal import ColourOption, WideOption, colour_wanted, echo, tables_are_wide, width
from nvscope.cli.undecoded import tell_of_truncated, tell_of_unfitting
from nvscope.cli.variables_asked import VariablesAsked, VariablesRead
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.view.documents.variables import ReadRows


@with_live_options
def variables(
    live: LiveOptions,
    sources: SourcesArgument = None,
    read: ReadOption = None,
    wanted: FilterOption = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    no_names: NoNamesOption = False,
    history: Annotated[
        str | None,
        typer.Option(
            "--history",
            metavar="NAME",
            help="Show every change of a variable, of all elements of a structure or array, or of what a pattern "
            "with * stands for, in each list, and on each page, that has it. LIST:NAME, or --list, for one of them; "
            "visu/ADDRESS/NAME for those of pages, db/FILE/NAME for those of databases.",
        ),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="With --history: every telegram, not only changes.")] = False,
    at: Annotated[
        str | None,
        typer.Option(
            "--at",
            metavar="TIME",
            help="Show the values as they were: 5s after the first frame, -2s before the end, #1234 (a frame), "
            "08:00:01.5, or '2026-01-31 08:00:01.5' (Z, +02:00).",
        ),
    ] = None,
    infer: Annotated[
        bool, typer.Option("--infer", help="Propose layouts of lists without a definition, from their values.")
    ] = False,
    listed: Annotated[
        str | None,
        typer.Option(
            "--list",
            metavar="LIST",
            help="Only this list: its name, identifier, or key as udp/1202/7; visu/ADDRESS for what pages asked a "
            "controller for, db/FILE for a database.",
            autocompletion=lists,
        ),
    ] = None,
    write: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--write",
            metavar="FILE",
            help="With --infer: the drafted .gvl; of several lists, one file each. - is stdout, with nothing else.",
        ),
    ] = None,
    force: ForceOption = False,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print JSON (nvscope.vars/1, nvscope.history/1, nvscope.at/1, nvscope.infer/1)."),
    ] = False,
    decode: DecodeOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    channel_map: ChannelMapOption = None,
    show_secrets: SecretsOption = False,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    wide: WideOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Show the variables of a capture: last value, when and how often it changed, and its bounds.

    Names of variables of lists come from the definition files that the PLC project exports. Variables of web
    visualization stand beside them, without any file; their names come from variable lists that are in the capture, or
    that the project names. So do those of DataLogger databases. Exits with 3 where a capture could not be read to its
    end.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    _check(gvl, history, every, at, infer, write, as_json=as_json)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.progress import watching

    between = asked_range(from_time, to_time, utc=utc)
    inquiry = Inquiry(captured(paths, live, plant, ports), plant, ports, watch=watching(quiet=quiet), asked=between)
    names = {} if no_names else plant.node_names
    asked = VariablesAsked(
        inquiry, wanted, as_json, utc, quiet, colour_wanted(colour), names, tables_are_wide(wide), show_secrets
    )  # fmt: skip
    warn_of_secrets(shown=show_secrets)
    if infer:
        told = propose(asked, listed, write, force=force)
    else:
        with flaws_told_first(plant.definition):
            if history is not None:
                told = _history(asked, history, listed, every)
            elif at is not None:
                told = _at(asked, at, listed)
            else:
                told = _last_values(asked, listed)
        tell_of_lists(inquiry)
    tell_of_channels(channel_map, told.channels)
    if code := tell_of_losses(told.infos):
        raise typer.Exit(code)


def _check(
    gvl: Sequence[str] | None,
    history: str | None,
    every: bool,
    at: str | None,
    infer: bool,
    write: str | None,
    *,
    as_json: bool,
) -> None:
    """Raise UsageError for options that do not go together."""
    from nvscope.whole_files import is_stdout

    asked = [
        name
        for name, given in (("--history", history is not None), ("--at", at is not None), ("--infer", infer))
        if given
    ]
    if len(asked) > 1:
        raise UsageError(f"{asked[0]} and {asked[1]} exclude each other", next_step="ask for one after the other")
    if every and history is None:
        raise UsageError("--all is for --history", next_step="add --history NAME, or leave --all out")
    if write == "":
        raise UsageError("the name of a file to write is empty", next_step="name one, or leave -w out")
    if write is not None and not infer:
        raise UsageError("-w is for --infer", next_step="`nvscope export` writes values to files")
    if write is not None and as_json and is_stdout(write):
        raise UsageError("--json and -w - both are for stdout", next_step="leave --json out, or name a file with -w")
    if infer and gvl:
        raise UsageError(
            "--infer is for lists without a definition", next_step="leave --gvl out, or --infer to see the values"
        )


def _last_values(asked: VariablesAsked, listed: str | None) -> VariablesRead:
    from nvscope.analysis.read_values import last_values, meant
    from nvscope.analysis.seen_lists import SeenLists
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.report import variables as face
    from nvscope.view.documents.variables import left_out, variables_document

    keys = asked.keys(listed)
    if asked.inquiry.paths:
        keep_freed_memory()
    seen, read_ones = SeenLists(), last_values(meant(None, listed))
    found = asked.inquiry.analyze(asked.wanted, values=True, causes=False, others=[seen, read_ones])
    rows: ReadRows = {}
    if read_ones.known:
        from nvscope.view.documents.read_rows import last_rows

        rows = last_rows(read_ones.known, secrets=asked.secrets)
    read = [one.read for one in read_ones.known.values()]
    if not any(rows.values()) and (problem := asked.nothing_of(listed, read, found.infos)):
        raise problem
    layouts = asked.inquiry.layouts
    undecoded = left_out(found.state, found.values, keys) if found.values else None
    unplaced = [entry for entry, _ in layouts.unplaced] if layouts else []
    some_came = any(undecoded or ()) or (keys is None and seen.saw_any(unplaced))
    missing: Sequence[Mapping[str, Any]] = ()
    if layouts:
        from nvscope.analysis.missing import missing_of_lists

        missing = missing_of_lists(found, asked.inquiry.project, keys, asked.names)
    asked.tell(
        variables_document(
            found.state, found.values, keys=keys, expression=asked.wanted, missing=missing, read_ones=rows
        ),
        lambda document: face.render(
            document, colour=asked.colour, width=width(), wide=asked.wide, utc=asked.utc, node_names=asked.names,
            some_came=some_came, of_one_list=keys is not None,
        ),
    )  # fmt: skip
    if undecoded:
        tell_of_unfitting(undecoded.unfitting, undecoded.unlike_known_part)
        if undecoded.truncated:
            tell_of_truncated(undecoded.truncated)
    tell_of_read_ones(read, hidden=hidden_in(rows))
    if listed is None and layouts:
        tell_of_missing(asked.inquiry, seen)
    return VariablesRead(found.infos, [bus.channel for bus in found.summary.can.buses])


def _history(asked: VariablesAsked, name: str, listed: str | None, every: bool) -> VariablesRead:
    """Write changes as they are found."""
    from nvscope.analysis.history import Changes
    from nvscope.analysis.read_values import read_source
    from nvscope.cli.progress import watching
    from nvscope.report.history import Json, Text
    from nvscope.view.documents.history import change_summary, row_of_change
    from nvscope.view.documents.variables import filter_told
    from nvscope.view.escape import visible

    changes = Changes(asked.inquiry, name, listed=listed, every=every, expression=asked.wanted, with_read=True)
    wanted, history = changes.selection, changes.history
    if asked.as_json:
        as_data()
    face = (
        Json(read_alone=changes.read_alone)
        if asked.as_json
        else Text(
            wanted.names(),
            changes.lists,
            subindexes=wanted.repeated,
            read_alone=changes.read_alone,
            width=width(),
            wide=asked.wide,
            colour=asked.colour,
            utc=asked.utc,
        )
    )
    out = sys.stdout
    begun = False
    for entries in changes.batches(watching(quiet=asked.quiet or out.isatty())):
        for entry in entries:
            if not begun:
                begun = True
                out.write(face.begin())
            out.write(face.line(row_of_change(entry, secrets=asked.secrets)))
        out.flush()
    if (
        changes.came_from_nobody
        and read_source(name) is None
        and (problem := asked.nothing_of(listed, [], changes.source.infos))
    ):
        raise problem
    changes.check()
    if not begun:
        out.write(face.begin())
    chosen = filter_told(asked.wanted, changes.read.chosen, changes.read.telegrams)
    summary = change_summary(history) if history else []
    if changes.read_ones.known:
        from nvscope.view.documents.read_rows import summary_rows

        summary += summary_rows(changes.read_ones.known)
    for text in face.end(summary, chosen, some_came=changes.some_came):
        out.write(text)
    out.flush()
    if changes.unplaced:
        echo(f"nvscope: {visible(changes.unplaced)}.", err=True)
    if history:
        tell_of_unfitting(history.unfitting, history.unlike_known_part)
    read = [one.read for one in changes.read_ones.known.values()]
    tell_of_read_ones(read, hidden=0 if asked.secrets else sum(one.hidden for one in read))
    if listed is None and history:
        tell_of_missing(asked.inquiry, changes.seen)
    return VariablesRead.of(changes.source)


def _at(asked: VariablesAsked, text: str, listed: str | None) -> VariablesRead:
    """Show the values as they were at a time."""
    from nvscope.analysis.moment import at
    from nvscope.analysis.read_values import meant
    from nvscope.report import history as face
    from nvscope.view.asked_time import parse_time
    from nvscope.view.documents.history import at_document

    keys = asked.keys(listed)
    moment_asked = parse_time("--at", text, utc=asked.utc)
    found = at(
        asked.inquiry, moment_asked, expression=asked.wanted, utc=asked.utc, told=f"--at {text}",
        read_ones=meant(None, listed),
    )  # fmt: skip
    known = found.read_ones.known if found.read_ones else {}
    rows: ReadRows = {}
    if known:
        from nvscope.view.documents.read_rows import rows_at

        rows = rows_at(known, found.time_ns, secrets=asked.secrets)
    read = [one.read for one in known.values()]
    if not any(rows.values()) and (problem := asked.nothing_of(listed, read, found.source.infos)):
        raise problem
    asked.tell(
        at_document(
            found.moment, asked.inquiry.layouts, found.time_ns, keys=keys, expression=asked.wanted, read_ones=rows
        ),
        lambda document: face.render_at(document, colour=asked.colour, width=width(), wide=asked.wide, utc=asked.utc),
    )  # fmt: skip
    tell_of_read_ones(read, hidden=hidden_in(rows))
    return VariablesRead.of(found.source)
