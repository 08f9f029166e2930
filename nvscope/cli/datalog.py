"""``nvscope datalog``: variables recorded as a PLCnext DataLogger does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from msgspec.structs import replace

from nvscope.cli.datalog_config import config as config_verb
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption, tell_of_flaws
from nvscope.cli.help import Command, Group
from nvscope.cli.live import LiveOptions, LiveRun, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.sources import (
    ChannelMapOption,
    FromTimeOption,
    ReadOption,
    ToTimeOption,
    asked_range,
    tell_of_losses,
)
from nvscope.cli.terminal import echo
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source, SourceInfo
    from nvscope.datalogger.configuration import Session
    from nvscope.datalogger.datalog import DataLog
    from nvscope.datalogger.plan import Planned

_LOG = "log"
_PATIENCE_S = 3.0
_DATABASES = frozenset({"sqlite", "datalogger"})


class _Sources(Group):
    """The verb logs what it is told to; a word that is no verb of it is a source."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if not args or args[0] not in self.commands:
            args = [_LOG, *args]
        return super().parse_args(ctx, args)


class _Log(Command):
    """What is done without a verb is called as the whole."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        if parent is not None:
            info_name, parent = parent.info_name, parent.parent
        return super().make_context(info_name, args, parent, **extra)


app = typer.Typer(rich_markup_mode=None, cls=_Sources)
app.command(cls=Command)(config_verb)


@app.callback()
def _verbs() -> None:
    """Record variables as a PLCnext DataLogger does."""


@app.command(_LOG, cls=_Log)
@with_live_options
def datalog(
    live: LiveOptions,
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SOURCE...",
            help="Capture files, directories of them, or - for stdin; or an interface, udp://ADDRESS:PORT or "
            "can:INTERFACE:CHANNEL; and definition files, as for --gvl.",
            show_default=False,
        ),
    ] = None,
    read: ReadOption = None,
    config: Annotated[
        list[str] | None,
        typer.Option(
            "--config",
            metavar="FILE",
            help="The configuration of a session, as a controller reads it; also several.",
            show_default=False,
        ),
    ] = None,
    write: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--write",
            metavar="FILE",
            help="The database, in place of the dst of the configuration; of a volatile session, too, which is a file "
            "then.",
            show_default=False,
        ),
    ] = None,
    folder: Annotated[
        str | None,
        typer.Option(
            "--folder",
            metavar="DIR",
            help="Where databases are put, by the names that the configurations give them.",
            show_default=False,
        ),
    ] = None,
    append: Annotated[
        bool, typer.Option("--append", help="Go on with databases that exist, as a controller does that restarts.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace databases that exist, with their closed files.")
    ] = False,
    partly: Annotated[
        bool,
        typer.Option("--partly", help="Leave out variables that no list has, as a controller does, and say which."),
    ] = False,
    document_style: Annotated[
        bool,
        typer.Option(
            "--document-style",
            help="Write what the reference shows, where controllers differ from it: counters also of values that have "
            "not changed, and 0 as ConsistentDataSeries of the first row.",
        ),
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Say what would be logged, and how large it would be a day; write nothing."),
    ] = False,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    channel_map: ChannelMapOption = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress, and no word at the end.")] = False,
) -> None:
    """Record variables of lists into SQLite databases, as the DataLogger of a PLCnext controller does.

    Of captures, the same packets give the same database. Where the network lost something, the first row behind it has
    0 as ConsistentDataSeries. Ends live with Ctrl-C, --for or -a. `nvscope datalog config` writes a configuration.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    if not config:
        raise UsageError(
            "no configuration is named", next_step="add --config FILE.xml; `nvscope datalog config NAME…` writes one"
        )
    if write is not None and folder is not None:
        raise UsageError("-w and --folder exclude each other", next_step="leave one of them out")
    if write is not None and len(config) > 1:
        raise UsageError("-w names one file, and there are several sessions", next_step="use --folder DIR")
    for option, text in (("-w", write), ("--folder", folder)):
        if text == "":
            raise UsageError(f"{option} is empty", next_step="write a name behind it, or leave it out")
    if append and force:
        raise UsageError("--append and --force exclude each other", next_step="leave one of them out")
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.streams import KeptStreams, is_stream
    from nvscope.cli.progress import watching
    from nvscope.datalogger.claims import Claims
    from nvscope.datalogger.plan import Targets, check_leave, check_names, near_tasks, plan, set_aside
    from nvscope.view.escape import visible
    from nvscope.whole_files import identity_of

    tell_of_flaws(plant.definition)
    sessions = _sessions(config)
    between = asked_range(from_time, to_time, utc=True)
    inquiry = Inquiry(captured(paths, live, plant, ports), plant, ports, watch=watching(quiet=quiet), asked=between)
    planned = plan(sessions, inquiry.defined_layouts(), plant.datalogger, Targets(write, folder), partly=partly)
    for told in near_tasks(sessions, plant.datalogger):
        echo(f"nvscope: {visible(told)}.", err=True)
    _tell_of_plan(planned, append=append)
    infos: Sequence[SourceInfo] = ()
    source = None
    streams = [path for path in inquiry.paths if is_stream(path)]
    if not streams and not (dry_run and inquiry.read_once):
        source = inquiry.open()
        _refuse_databases(source)
        infos = source.infos
    # Of a directory, these are the captures in it.
    read_from = (*paths, *(info.path for info in infos), *plant.inputs, *config)
    inputs = {identity for path in read_from if (identity := identity_of(path))}

    def is_input(path: str) -> bool:
        return identity_of(path) in inputs

    if dry_run:
        if source is not None:
            source.stop()
        _check_ending(write)
        from nvscope.datalogger.forecast import forecast
        from nvscope.datalogger.refusals import refusal

        def refused(one: Planned) -> str:
            return refusal(one, is_input, append=append, force=force)

        for line in forecast(planned, plant.definition.nominal_intervals_ns(), refused, append=append):
            echo(line)
        return
    check_names(planned, is_input)
    _check_ending(write)
    with Claims([one.path for one in planned if one.path]) as claims, KeptStreams(streams, _patience(quiet)) as kept:
        for path in claims.unguarded:
            what = "its file system knows no locks: take care that nothing else logs there at the same time"
            echo(f"nvscope: {visible(path)}: {what}.", err=True)
        check_leave(planned, append=append, force=force)
        if source is None:
            # What is known of senders in the end says what telegrams were in the beginning.
            with LiveRun(kept, quiet=True):
                kept.keep()
            inquiry = replace(inquiry, copies=kept.copies)
            source = inquiry.open()
            _refuse_databases(source)
        aside = set_aside(planned if force else ())
        try:
            log = _logged(inquiry, source, planned, quiet=quiet, append=append, document_style=document_style)
        finally:
            stays, troubles = aside.settle()
            for told in troubles:
                echo(f"nvscope: {visible(told)}.", err=True)
    if not quiet:
        _tell(log)
        _tell_of_drops(source)
    for path in stays:
        echo(f"nvscope: {visible(path)}: what was there stays: no row came to take its place.", err=True)
    lost = bool(troubles) or any(one.counted.not_written for one in log.sessions)
    code = max(tell_of_losses(source.infos), ExitCode.DATA_LOSS if lost else ExitCode.GOOD)
    if code:
        raise typer.Exit(code)


def _patience(quiet: bool) -> Callable[[str], None]:
    """Return what says, once, that nothing is logged before a stream has ended, where that takes a while."""
    from nvscope.view.escape import visible

    due_s = time.monotonic() + _PATIENCE_S
    told = quiet

    def wait(word: str) -> None:
        nonlocal told
        if not told and time.monotonic() > due_s:
            told = True
            what = "read like a file, to its end, before the first row is written; --follow logs what comes at once"
            echo(f"nvscope: {visible(word)}: {what}.", err=True)

    return wait


def _check_ending(write: str | None) -> None:
    """Raise UsageError where the name of a database is that of a table, or a capture, as other verbs write them."""
    import os

    from nvscope.capture.formats import FORMATS
    from nvscope.export.files import format_of

    if write is None:
        return
    if write == "-":
        raise UsageError("a database is a file, and cannot be written to stdout", next_step="name one behind -w")
    ending = os.path.splitext(write)[1].lower()
    next_step = "name it .db; `nvscope export FILE.db -w` writes its rows as a table"
    try:
        format_of(write)
    except UsageError:
        if not any(ending in known.suffixes for known in FORMATS if known.name not in _DATABASES):
            return
        next_step = "name it .db; captures are written by record and convert"
    raise UsageError(f"a database is written, and {ending} is no ending of one", where=write, next_step=next_step)


def _sessions(config: Sequence[str]) -> list[Session]:
    """Return the sessions of configuration files, and say what nobody knows of them."""
    from nvscope.datalogger.configuration_file import read_configuration
    from nvscope.view.escape import visible

    found = []
    for path in config:
        configuration = read_configuration(path)
        for told in configuration.unknown:
            echo(f"nvscope: {visible(told)}.", err=True)
        found.append(configuration.session)
    return found


def _logged(
    inquiry: Inquiry, source: Source, planned: Sequence[Planned], *, quiet: bool, append: bool, document_style: bool
) -> DataLog:
    """Log captures, or what comes live; whatever ends it, what was taken is written."""
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.datalogger.judging import Judge, StateSoFar, WholeCapture
    from nvscope.datalogger.plan import data_log

    whole = not inquiry.read_once
    keys = {key for one in planned for key in one.keys}
    state = None
    judge: Judge
    if whole:
        keep_freed_memory()
        judge = WholeCapture(inquiry, keys, holds_drops=_hold_drops(source))
    else:
        state = inquiry.state()
        judge = StateSoFar(state, keys, inquiry.project.definition.nominal_intervals_ns(), source)
    log = data_log(
        planned, inquiry.defined_layouts(), judge, append=append, durable=not whole, document_style=document_style
    )
    try:
        if whole:
            for _ in inquiry.run(source, [log]):
                pass
        else:
            assert state is not None
            with LiveRun(source, quiet=quiet) as progress:
                for _ in inquiry.run(source, [state, log]):
                    progress()
    finally:
        log.end()
    return log


def _hold_drops(source: Source) -> bool:
    """Return whether captures are of formats that say what was lost."""
    from nvscope.capture.formats import FORMATS

    holding = {known.name for known in FORMATS if known.holds_drops}
    return any(info.format in holding for info in source.infos)


def _refuse_databases(source: Source) -> None:
    """Say that databases are no telegrams; UsageError where there is nothing else."""
    from nvscope.view.escape import visible

    databases = [info.path for info in source.infos if info.format == "datalogger"]
    if databases and len(databases) == len(source.infos):
        raise UsageError(
            "rows of databases are not logged again, and no capture is given", where=databases[0],
            next_step="name the capture of the telegrams; `nvscope export` writes the rows of databases",
        )  # fmt: skip
    for path in databases:
        echo(f"nvscope: {visible(path)}: rows of databases are not logged again.", err=True)


def _tell_of_plan(planned: Sequence[Planned], *, append: bool) -> None:
    """Say which variables are left out, and what no session can be meant to do."""
    from nvscope.datalogger.growth import always_full
    from nvscope.view.escape import visible

    for one in planned:
        for error in one.left_out:
            echo(f"nvscope: {visible(error.where)}: {visible(error.what)}; left out.", err=True)
        if told := always_full(one, append=append):
            echo(f"nvscope: {visible(told)}.", err=True)


def _tell_of_drops(source: Source) -> None:
    """Say which captures tell of packets that were dropped; of live sources it is said anyway."""
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    for info in source.infos:
        if info.drops and not info.is_live:
            what = f"{count_of(info.drops, 'packet')} dropped while capturing"
            rows = "rows tell of those that a row came behind, and of no others"
            echo(f"nvscope: {visible(info.path)}: the capture says {what}; {rows}.", err=True)


def _tell(log: DataLog) -> None:
    from nvscope.datalogger.outcome import outcome

    heard = log.heard
    for one in log.sessions:
        for line in outcome(one, heard):
            echo(f"nvscope: {line}", err=True)
