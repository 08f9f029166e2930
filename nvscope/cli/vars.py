"""``nvscope vars``: the variables of a capture, by name."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from nvscope.cli.completion import lists
from nvscope.cli.definitions import (
    GvlOption,
    NoNamesOption,
    ProjectOption,
    flaws_told_first,
    project_of,
    tell_of_lists,
    tell_of_missing,
)
from nvscope.cli.encodings import as_data
from nvscope.cli.live import LiveOptions, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.sources import (
    ChannelMapOption,
    DecodeOption,
    FilterOption,
    ForceOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    port_rules,
    tell_of_channels,
    tell_of_losses,
    with_channels,
)
from nvscope.cli.terminal import ColourOption, WideOption, colour_wanted, echo, tables_are_wide, tell, width
from nvscope.cli.undecoded import tell_of_truncated, tell_of_unfitting
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source, SourceInfo
    from nvscope.list_key import ListKey


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
            "with * stands for, in each list that has it. LIST:NAME, or --list, for one of them.",
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
            help="Only this list: its name, identifier, or key as udp/1202/7.",
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
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    wide: WideOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Show the variables of a capture: last value, when and how often it changed, and its bounds.

    Their names come from the definition files that the PLC project exports. Exits with 3 where a capture could not be
    read to its end.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    ports = port_rules(decode)
    _check(gvl, history, every, at, infer, write, as_json=as_json)
    plant = with_channels(project_of(project, gvl, paths), channel_map)
    if not infer and not plant.files:
        _check_readable([] if live.follow else paths)
        raise UsageError(
            "no definition is given",
            next_step="name the exported list and its types with --gvl FILE or in nvscope.toml, or propose a layout "
            "with --infer",
        )

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.progress import watching

    between = asked_range(from_time, to_time, utc=utc)
    inquiry = Inquiry(captured(paths, live, plant, ports), plant, ports, watch=watching(quiet=quiet), asked=between)
    names = {} if no_names else plant.node_names
    asked = _Asked(inquiry, wanted, as_json, utc, quiet, colour_wanted(colour), names, tables_are_wide(wide))
    if infer:
        told = _infer(asked, listed, write, force=force)
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


class _Read(NamedTuple):
    """What the captures that were read say of themselves, and what their channels are called."""

    infos: Sequence[SourceInfo]
    channels: Sequence[str]

    @classmethod
    def of(cls, source: Source) -> _Read:
        return cls(source.infos, source.channels)


@dataclass(frozen=True)
class _Asked:
    """What was asked of which captures, and how it is to be told."""

    inquiry: Inquiry
    wanted: str | None
    as_json: bool
    utc: bool
    quiet: bool
    colour: bool
    names: Mapping[str, str]
    wide: bool

    def keys(self, listed: str | None) -> Collection[ListKey] | None:
        """Return the keys of the lists of a name, None for all; UsageError where there is none."""
        layouts = self.inquiry.defined_layouts()
        if listed is None:
            return None
        from nvscope.definition.selection import lists_named, names_of_lists

        return {key for key, _ in lists_named(names_of_lists(layouts), listed, layouts.unplaced)}

    def tell(self, document: Mapping[str, Any], render: Callable[[Mapping[str, Any]], str]) -> None:
        """Print a document as JSON, or as ``render`` makes it."""
        tell(document, render, as_json=self.as_json, colour=self.colour)


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


def _check_readable(paths: Sequence[str]) -> None:
    """Raise what is wrong with files: where no definition is given, the name of one may be mistyped."""
    from nvscope.capture.live.open import is_live, is_stream
    from nvscope.capture.open import open_source

    files = [path for path in paths if not is_stream(path) and not is_live(path)]
    if files:
        open_source(files)


def _last_values(asked: _Asked, listed: str | None) -> _Read:
    from nvscope.analysis.missing import missing_of_lists
    from nvscope.analysis.seen_lists import SeenLists
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.report import variables as face
    from nvscope.view.documents.variables import left_out, variables_document

    keys = asked.keys(listed)
    if asked.inquiry.paths:
        keep_freed_memory()
    seen = SeenLists()
    found = asked.inquiry.analyze(asked.wanted, values=True, causes=False, others=[seen])
    assert found.values
    undecoded = left_out(found.state, found.values, keys)
    unplaced = [entry for entry, _ in asked.inquiry.defined_layouts().unplaced]
    some_came = any(undecoded) or (keys is None and seen.saw_any(unplaced))
    missing = missing_of_lists(found, asked.inquiry.project, keys, asked.names)
    asked.tell(
        variables_document(found.state, found.values, keys=keys, expression=asked.wanted, missing=missing),
        lambda document: face.render(
            document, colour=asked.colour, width=width(), wide=asked.wide, utc=asked.utc, node_names=asked.names,
            some_came=some_came, of_one_list=keys is not None,
        ),
    )  # fmt: skip
    tell_of_unfitting(undecoded.unfitting, undecoded.unlike_known_part)
    if undecoded.truncated:
        tell_of_truncated(undecoded.truncated)
    if listed is None:
        tell_of_missing(asked.inquiry, seen)
    return _Read(found.infos, [bus.channel for bus in found.summary.can.buses])


def _history(asked: _Asked, name: str, listed: str | None, every: bool) -> _Read:
    """Write changes as they are found."""
    from nvscope.analysis.history import Changes
    from nvscope.cli.progress import watching
    from nvscope.report.history import Json, Text
    from nvscope.view.documents.history import change_row, change_summary
    from nvscope.view.documents.variables import filter_told
    from nvscope.view.escape import visible

    changes = Changes(asked.inquiry, name, listed=listed, every=every, expression=asked.wanted)
    wanted, history = changes.selection, changes.history
    if asked.as_json:
        as_data()
    face = (
        Json()
        if asked.as_json
        else Text(
            wanted.names(),
            changes.lists,
            subindexes=wanted.repeated,
            width=width(),
            wide=asked.wide,
            colour=asked.colour,
            utc=asked.utc,
        )
    )
    out = sys.stdout
    out.write(face.begin())
    for entries in changes.batches(watching(quiet=asked.quiet or out.isatty())):
        for entry in entries:
            out.write(face.line(change_row(entry)))
        out.flush()
    chosen = filter_told(asked.wanted, history.read.chosen, history.read.telegrams)
    out.write(face.end(change_summary(history), chosen, some_came=changes.some_came))
    out.flush()
    if changes.unplaced:
        echo(f"nvscope: {visible(changes.unplaced)}.", err=True)
    tell_of_unfitting(history.unfitting, history.unlike_known_part)
    if listed is None:
        tell_of_missing(asked.inquiry, changes.seen)
    return _Read.of(changes.source)


def _at(asked: _Asked, text: str, listed: str | None) -> _Read:
    """Show the values as they were at a time."""
    from nvscope.analysis.moment import at
    from nvscope.report import history as face
    from nvscope.view.asked_time import parse_time
    from nvscope.view.documents.history import at_document

    keys = asked.keys(listed)
    moment_asked = parse_time("--at", text, utc=asked.utc)
    found = at(asked.inquiry, moment_asked, expression=asked.wanted, utc=asked.utc, told=f"--at {text}")
    asked.tell(
        at_document(
            found.moment, asked.inquiry.defined_layouts(), found.time_ns, keys=keys, expression=asked.wanted
        ),
        lambda document: face.render_at(document, colour=asked.colour, width=width(), wide=asked.wide, utc=asked.utc),
    )  # fmt: skip
    return _Read.of(found.source)


def _infer(asked: _Asked, listed: str | None, write: str | None, *, force: bool) -> _Read:
    """Propose layouts, and draft definition files of them."""
    from nvscope.analysis.inference import infer
    from nvscope.definition.gvl_text import gvl_text
    from nvscope.report import inference as face
    from nvscope.units import count_of
    from nvscope.view.documents.inference import drafts, inference_document, proposals
    from nvscope.whole_files import WholeFiles, is_stdout

    inferred = infer(asked.inquiry, expression=asked.wanted)
    samples, source = inferred.samples, inferred.source
    if inferred.some_on_can:
        echo(
            "nvscope: lists on CAN are not proposed: a frame does not tell how many variables it has.", err=True
        )  # fmt: skip
    found = proposals(samples, listed)
    made = drafts(found) if write is not None else []
    if write is None or not is_stdout(write):
        asked.tell(
            inference_document(found, samples),
            lambda document: face.render(document, colour=asked.colour, width=width(), wide=asked.wide),
        )
    elif len(made) > 1:
        raise UsageError(
            f"{count_of(len(made), 'draft')} cannot be written to stdout side by side",
            next_step="choose one with --list, or name a file: each list gets its own",
        )
    if write is None:
        return _Read.of(source)
    if not made:
        echo(f"nvscope: nothing to draft, {write} was not written.", err=True)
    drafted = [*zip(made, _draft_paths(write, [(draft.port, draft.list_id) for draft in made]), strict=True)]
    files = WholeFiles([*(info.path for info in source.infos), *asked.inquiry.project.inputs], force=force)
    try:
        for draft, path in drafted:
            # Somebody may have worked on a draft: one that is there already stays, whatever its name.
            files.write(str(path), gvl_text(draft).encode())
        files.publish()
    except BaseException:
        files.discard()
        raise
    for draft, path in drafted:
        note = f"; it does not fit the wire: {draft.problem}" if draft.problem else ""
        echo(f"nvscope: {path}: draft of list {draft.list_id}, {_CHECK}{note}.", err=True)
    return _Read.of(source)


_CHECK = "to be checked against the PLC project"


def _draft_paths(write: str, lists: list[tuple[int, int]]) -> list[Path]:
    """Return the file of each list: as named, or with identifier (and port, if need be) where there are several."""
    path = Path(write)
    if len(lists) == 1:
        return [path]
    if not path.name or path.name == "..":
        raise UsageError("no name of a file", where=write, next_step="name one, such as draft.gvl, with -w")
    identifiers = [index for _, index in lists]
    return [
        path.with_name(f"{path.stem}-{f'{port}-' if identifiers.count(index) > 1 else ''}{index}{path.suffix}")
        for port, index in lists
    ]
