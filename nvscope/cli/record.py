"""``nvscope record``: packets to files, as long as they come."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.cli.counts import at_least_one
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption, tell_of_flaws
from nvscope.cli.frame_files import check_sources
from nvscope.cli.limits import file_limits
from nvscope.cli.live import LiveOptions, LiveRun, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.sources import (
    ChannelMapOption,
    ForceOption,
    ReadOption,
    SourcesArgument,
    duration_ns,
    tell_of_losses,
)
from nvscope.cli.terminal import echo
from nvscope.errors import CaptureError, ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source
    from nvscope.record.flight_recorder import FlightRule, Flights
    from nvscope.record.recorder import Beside, Recorder, Recording

_TO_DISK_NS = 5_000_000_000
_RING_BYTES = 1 << 20  # of the last frames, which nobody looks at
_PRE, _POST, _MAX_RATE, _MIN_FREE, _RING_MIB = "10s", "5s", 6, 1.0, 256


@with_live_options
def record(
    live: LiveOptions,
    sources: SourcesArgument = None,
    write: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--write",
            metavar="FILE",
            help="The file to write, in the format of its ending: .mcap, .pcapng, .pcap, or .log for CAN.",
            show_default=False,
        ),
    ] = None,
    read: ReadOption = None,
    switch: Annotated[
        list[str] | None,
        typer.Option(
            "-b",
            "--ring-buffer",
            metavar="WHAT:N",
            help="One file after the other: each of duration:N seconds, packets:N, or filesize:N kB; of more than "
            "files:N, the oldest is removed.",
            show_default=False,
        ),
    ] = None,
    fsync: Annotated[
        str | None,
        typer.Option(
            "--fsync",
            metavar="DURATION",
            help="So often, what was recorded is waited for to be on the disk, where it survives a power cut; 5s.",
            show_default=False,
        ),
    ] = None,
    packets_only: Annotated[
        bool,
        typer.Option(
            "--packets-only",
            help="No topics: an .mcap file is smaller, and sooner written, without the variables, figures and causes "
            "that other tools show. nvscope makes them of the packets.",
        ),
    ] = False,
    trigger: Annotated[
        str | None,
        typer.Option(
            "--trigger",
            metavar="EXPR",
            help="Write a file for each event: where EXPR becomes true, of telegrams ('var.fTemp > 80', "
            "'list.lost > 0', 'held(var.bDown, 2s)'), or of causes and findings ('cause.kind == \"second-sender\"'). "
            "-w names a directory, or how names begin and end.",
            show_default=False,
        ),
    ] = None,
    pre: Annotated[
        str | None,
        typer.Option("--pre", metavar="DURATION", help="With --trigger, so long before the event.", show_default=_PRE),
    ] = None,
    post: Annotated[
        str | None,
        typer.Option("--post", metavar="DURATION", help="With --trigger, so long behind it.", show_default=_POST),
    ] = None,
    max_rate: Annotated[
        int | None,
        typer.Option(
            "--max-rate",
            metavar="N",
            parser=at_least_one,
            help="With --trigger, at most so many events a minute.",
            show_default=str(_MAX_RATE),
        ),
    ] = None,
    min_free: Annotated[
        float | None,
        typer.Option(
            "--min-free",
            metavar="GB",
            min=0,
            help="With --trigger, so much of the disk stays free.",
            show_default=str(_MIN_FREE),
        ),
    ] = None,
    ring: Annotated[
        int | None,
        typer.Option(
            "--ring",
            metavar="MIB",
            parser=at_least_one,
            help="With --trigger, memory for what was before events.",
            show_default=str(_RING_MIB),
        ),
    ] = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    force: ForceOption = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress, and no word at the end.")] = False,
) -> None:
    """Record what comes to a file, which every verb reads: each packet is in it within a second.

    An .mcap file holds the definitions and the project file, too, and is read with them. It is ended by Ctrl-C, --for
    or -a; the file is whole whenever that is, and also where the disk is full or the interface gone, which exits with
    5. After a power cut, `nvscope report` reads what had come by then. A file that exists stays as it is, unless
    --force is given.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    if not write:
        raise UsageError("no file to write is named", next_step="add -w FILE.mcap, .pcapng or .pcap")
    rule = file_limits(switch or ())
    of_events = {"--pre": pre, "--post": post, "--max-rate": max_rate, "--min-free": min_free, "--ring": ring}
    from nvscope.whole_files import exists_already, identity_of, is_input, is_stdout, would_be_lost

    if trigger is None:
        for option, value in of_events.items():
            if value is not None:
                raise UsageError(
                    f"{option} is of the events of --trigger", next_step="add --trigger EXPR, or leave it out"
                )
        if os.path.isdir(write):
            raise UsageError(
                f"{write} is a directory",
                next_step="name a file in it, such as plant.mcap; --trigger takes a directory",
            )
        if rule and is_stdout(write):
            raise UsageError("-b makes files, and -w - is stdout", next_step="name a file with -w, or leave -b out")
    to_disk_ns = _TO_DISK_NS if fsync is None else duration_ns("--fsync", fsync)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.progress import watching
    from nvscope.cli.scenes import are_read_whole
    from nvscope.record.attachments import attachments_of
    from nvscope.record.circumstances import circumstances_of
    from nvscope.record.file_series import FileRule
    from nvscope.record.flight_recorder import FlightRule
    from nvscope.record.recorder import Beside, Recorder

    tell_of_flaws(plant.definition)
    inquiry = Inquiry(captured(paths, live, plant, ports), plant, ports, watch=watching(quiet=quiet))
    source = inquiry.open()
    check_sources(source.infos)
    inputs = {identity_of(path) for path in (*paths, *(one.path for one in source.infos), *plant.inputs)}
    if (identity := identity_of(write)) is not None and identity in inputs:
        raise is_input(write)
    if trigger is not None and rule:
        raise UsageError("-b and --trigger exclude each other", next_step="leave one of them out")
    if not force and not rule and trigger is None and would_be_lost(write):
        raise exists_already(write)
    topics = None
    if not packets_only:
        from nvscope.record.recorded_topics import RecordedTopics

        topics = RecordedTopics.of(plant.definition, inquiry.layouts)
    beside = Beside(
        lambda: source.channels,
        [*attachments_of(plant.inputs, plant.path), *(source.attachments if plant.recording else ())],
        lambda: circumstances_of(source.infos, live.bpf),
        topics,
        diary=trigger is None and not packets_only,
    )
    if trigger is not None:
        rule_of_events = FlightRule(
            duration_ns("--pre", pre or _PRE, least_ns=0),
            duration_ns("--post", post or _POST, least_ns=0),
            max_rate or _MAX_RATE,
            int((_MIN_FREE if min_free is None else min_free) * 1_000_000_000),
        )
        _wait_for_events(inquiry, source, trigger, write, rule_of_events, beside, ring or _RING_MIB, quiet=quiet)
        return
    recorder = Recorder(
        beside,
        FileRule(rule.get("duration"), rule.get("packets"), rule.get("filesize"), rule.get("files")),
        to_disk_ns=to_disk_ns,
        replaces=force,
        is_live=not are_read_whole(inquiry),
    )
    recorder.start(write)
    if packets_only or not recorder.has_topics:
        state = _recorded(inquiry, source, recorder, quiet=quiet)
    else:
        state = _noted(inquiry, source, recorder, quiet=quiet)
    if not quiet or state.failure:
        _tell(state)
    code = max(tell_of_losses(source.infos), ExitCode.CAPTURE if state.failure else ExitCode.GOOD)
    if code:
        raise typer.Exit(code)


def _recorded(inquiry: Inquiry, source: Source, recorder: Recorder, *, quiet: bool) -> Recording:
    """Record a source to its end, or until it cannot be written any more; whatever ends it, the file is whole."""
    try:
        with LiveRun(source, quiet=quiet) as progress:
            for _ in inquiry.run(source, [recorder]):
                progress()
                if not _goes_on(recorder):
                    source.stop()
    finally:
        state = recorder.stop()
    assert state is not None
    return state


def _noted(inquiry: Inquiry, source: Source, recorder: Recorder, *, quiet: bool) -> Recording:
    """Record as ``_recorded``, and each second what is known then."""
    from nvscope.analysis.watching import Watching, scene_at
    from nvscope.cli.scenes import scenes
    from nvscope.record.diary import Diary

    # What happened in a capture is known before it is recorded: nothing is told late, or as what turns out to be wrong.
    known = scene_at(inquiry, None, Watching(_RING_BYTES)) if not recorder.is_live else None
    diary, how = Diary(known), Watching(_RING_BYTES, others=[recorder])
    try:
        recorder.note(diary.known)
        for scene in scenes(inquiry, how, source, quiet=quiet, sparingly=True, causes=known is None):
            recorder.note(list(diary.entries(scene)))
            if not _goes_on(recorder):
                break
    finally:
        state = recorder.stop()
    assert state is not None
    return state


def _wait_for_events(
    inquiry: Inquiry, source: Source, expression: str, path: str, rule: FlightRule, beside: Beside, ring_mib: int, *,
    quiet: bool,
) -> None:  # fmt: skip
    """Write a file for each event until the source ends, and say which."""
    from nvscope.analysis.watching import Watching
    from nvscope.cli.scenes import scenes
    from nvscope.record.events import EventsOfScenes, is_of_scenes
    from nvscope.record.flight_recorder import FlightRecorder
    from nvscope.record.frame_events import FrameEvents

    _check_target(path)
    found = FrameEvents(expression, inquiry.fields, inquiry.reading())
    of_scenes = is_of_scenes(found.chosen)
    flight = FlightRecorder(
        path, rule, lambda: beside, inquiry.reading(), None if of_scenes else found,
        ring_bytes=ring_mib << 20, trigger=expression,
    )  # fmt: skip
    try:
        if of_scenes:
            events = EventsOfScenes(expression)
            for scene in scenes(inquiry, Watching(_RING_BYTES, others=[flight]), source, quiet=quiet):
                for since_ns, what, told in events.new(scene):
                    flight.happened(since_ns, what, told)
                if flight.done.failure:
                    break
        else:
            with LiveRun(source, quiet=quiet) as progress:
                for _ in inquiry.run(source, [flight]):
                    progress()
                    if flight.done.failure:
                        source.stop()
    finally:
        done = flight.stop()
    _tell_of_events(done, rule, quiet=quiet)
    lost = ExitCode.DATA_LOSS if done.no_room else ExitCode.GOOD
    if code := max(tell_of_losses(source.infos), ExitCode.CAPTURE if done.failure else lost):
        raise typer.Exit(code)


def _check_target(path: str) -> None:
    """Raise what would keep the first event from being written: nobody is there when it comes."""
    from nvscope.capture.formats import written_as
    from nvscope.capture.open import open_sink

    if path.endswith(os.sep) and os.path.isdir(os.path.dirname(path.rstrip(os.sep)) or "."):
        with suppress(OSError):  # which is told below
            os.mkdir(path)
    folder = path if os.path.isdir(path) else os.path.dirname(path) or "."
    if not os.path.isdir(folder) or not os.access(folder, os.W_OK):
        what = "cannot be written to" if os.path.isdir(folder) else "no such directory"
        raise CaptureError(what, where=folder, next_step="make it, or name another one with -w")
    if not os.path.isdir(path) and written_as(path) is None:
        open_sink(path)  # says which endings there are


def _tell_of_events(done: Flights, rule: FlightRule, *, quiet: bool) -> None:
    from nvscope.units import count_of, data_size
    from nvscope.view.escape import visible

    def tell(text: str) -> None:
        echo(f"nvscope: {text}", err=True)

    if not quiet:
        tell(f"{count_of(done.events, 'event')} in {count_of(len(done.files), 'file')}.")
        for path in done.files:
            tell(visible(path))
    if done.too_many:
        tell(f"{count_of(done.too_many, 'event')} beyond {rule.per_minute} a minute (--max-rate): in no file.")
    if done.no_room:
        free = data_size(rule.free_bytes)
        tell(f"{count_of(done.no_room, 'event')} with less than {free} of free disk (--min-free): in no file.")
    if done.shortened:
        tell(f"{count_of(done.shortened, 'file')} begin later than --pre says: --ring takes more memory.")
    if done.failure:
        tell(f"ended: {visible(done.failure)}.")


def _goes_on(recorder: Recorder) -> bool:
    state = recorder.state
    return state is None or state.is_on


def _tell(state: Recording) -> None:
    from nvscope.view.escape import visible
    from nvscope.view.lines.plant.source_blocks import recorded_in_words

    told = recorded_in_words(state.frames, state.files, state.path)
    failure = f": {visible(state.failure)}; what was recorded is whole" if state.failure else ""
    echo(f"nvscope: {told}{failure}.", err=True)
