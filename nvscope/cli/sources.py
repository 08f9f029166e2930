"""The options by which every verb is told what to read."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from fnmatch import fnmatchcase
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from nvscope.cli.completion import expressions
from nvscope.cli.terminal import echo
from nvscope.duration import parse_duration
from nvscope.enumeration import first_few
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.analysis.not_whole import NotWhole
    from nvscope.capture.recordings import Recording
    from nvscope.capture.source import SourceInfo
    from nvscope.definition.project import Project
    from nvscope.view.asked_time import AskedRange

SourcesArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="SOURCE...",
        help="Capture files, DataLogger databases, directories of them, or - for stdin; or an interface, "
        "udp://ADDRESS:PORT or can:INTERFACE:CHANNEL; and definition files, as for --gvl.",
        show_default=False,
    ),
]
FilesArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="FILE...",
        help="Capture files, or directories of them; and definition files, as for --gvl.",
        show_default=False,
    ),
]
ReadOption = Annotated[
    list[str] | None, typer.Option("-r", metavar="SOURCE", help="The same as an argument.", show_default=False)
]
FilterOption = Annotated[
    str | None,
    typer.Option(
        "-Y",
        "--filter",
        metavar="EXPR",
        autocompletion=expressions,
        help="Show only what it chooses, such as 'nv.index == 7 && nv.flags.ack'; in Wireshark's syntax, over the "
        "fields of `nvscope keys --fields`.",
        show_default=False,
    ),
]
FromTimeOption = Annotated[
    str | None,
    typer.Option(
        "--from-time",
        metavar="T",
        help="Leave out all frames before T, as if the capture began there: 5s after its first frame, -2s before its "
        "end, a local time such as 08:00:01.5, or 2026-01-31 08:00:01.5Z. Frame numbers count from there.",
        show_default=False,
    ),
]
ToTimeOption = Annotated[
    str | None,
    typer.Option(
        "--to-time", metavar="T", help="Leave out all frames behind T, written as for --from-time.", show_default=False
    ),
]

_MOST_TOPICS = 20

ForceOption = Annotated[bool, typer.Option("--force", help="Replace files that exist and would be kept.")]

ChannelMapOption = Annotated[
    list[str] | None,
    typer.Option(
        "--channel-map",
        metavar="OLD=NEW[,...]",
        help="Call a channel of the captures otherwise, such as can1=press; two of one name are one bus. Goes before "
        "the table [channels] of the project.",
        show_default=False,
    ),
]

BitRateOption = Annotated[
    list[str] | None,
    typer.Option(
        "--bitrate",
        metavar="[CHANNEL@]RATE[,RATE]",
        help="Bit rate of CAN buses, of one channel or of all, behind a comma that of CAN FD's data phase; without it, "
        "what the project says, or what the frames tell.",
        show_default=False,
    ),
]

NOTHING_BETWEEN = "nvscope: no frame lies in the time that --from-time and --to-time leave."

_MOST_RECORDINGS = 3


def with_channels(project: Project, options: Sequence[str] | None) -> Project:
    """Return a project with the names that --channel-map gives; UsageError where one cannot be understood."""
    told: dict[str, str] = {}
    from nvscope.definition.buses import MAX_CHANNEL_NAME, is_channel_name

    for option in options or ():
        for text in option.split(","):
            old, sign, new = (part.strip() for part in text.partition("="))
            if not sign or not is_channel_name(old) or not is_channel_name(new):
                raise UsageError(
                    f"--channel-map {option[:80]}: expected OLD=NEW, names of 1 to {MAX_CHANNEL_NAME} characters",
                    next_step="for example --channel-map can1=press, or can1=can0,can2=can1",
                )
            if told.setdefault(old, new) != new:
                raise UsageError(
                    f"--channel-map gives {old} two names: {told[old]} and {new}", next_step="leave one of them out"
                )
    return replace(project, channels={**project.channels, **told}) if told else project


def tell_of_channels(options: Sequence[str] | None, seen: Sequence[str]) -> None:
    """Say on stderr which names of --channel-map no channel of the captures got; ``seen`` are those that they have."""
    for text in (text for option in options or () for text in option.split(",")):
        old, _, new = (part.strip() for part in text.partition("="))
        if new not in seen:
            _tell_of_channel("--channel-map", text, old, seen)


def tell_of_bit_rates(options: Sequence[str] | None, seen: Sequence[str]) -> None:
    """Say on stderr which --bitrate are of no channel of the captures; ``seen`` are those that they have."""
    for text in options or ():
        channel, sign, _ = text.rpartition("@")
        if sign and not any(channel == own or fnmatchcase(own, channel) for own in seen):
            _tell_of_channel("--bitrate", text, channel, seen)


def _tell_of_channel(option: str, text: str, name: str, seen: Sequence[str]) -> None:
    from nvscope.toml_table import nearest
    from nvscope.view.escape import visible

    known = visible(nearest(name, list(seen))) or "The captures have no channels."
    echo(f"nvscope: {option} {visible(text)}: no channel is called {visible(name)}. {known}", err=True)


def asked_range(
    from_time: str | None, to_time: str | None, *, utc: bool, options: tuple[str, str] = ("--from-time", "--to-time")
) -> AskedRange | None:
    """Return what two ``options`` say, None without any; UsageError where one cannot be understood."""
    if from_time is None and to_time is None:
        return None
    from nvscope.view.asked_time import parse_range

    return parse_range(from_time, to_time, utc=utc, options=options)


def duration_ns(option: str, text: str, *, least_ns: int = 1) -> int:
    """Return the duration that an option gives; UsageError where it is none, or less than ``least_ns``, 1 or 0."""
    try:
        duration = parse_duration(text)
    except ValueError as error:
        raise UsageError(f"{option}: {error}") from None
    if duration < least_ns:
        raise UsageError(f"{option} {text}: must {'be more than' if least_ns else 'not be less than'} 0")
    return duration


def tell_of_gaps(infos: Sequence[SourceInfo], start_ns: int | None, end_ns: int | None) -> None:
    """Say on stderr where nobody captured in the time of a report, and how to report on each recording."""
    from nvscope.capture.recordings import recordings
    from nvscope.units import duration
    from nvscope.view.escape import visible

    found = recordings(infos, start_ns, end_ns)
    if len(found) < 2:
        return
    before, behind = max(pairwise(found), key=lambda pair: pair[1].start_ns - pair[0].end_ns)
    told = (
        f"nvscope: {duration(behind.start_ns - before.end_ns)} without a capture lie between {visible(before.last)} "
        f"and {visible(behind.first)}: what was late or lost meanwhile is no fault."
    )
    if len(found) > 2:
        told += f" There are {len(found)} recordings."
    paths = [path for one in found[:_MOST_RECORDINGS] for path in dict.fromkeys((one.first, one.last))]
    if "-" not in paths:
        commands = [f"nvscope report {_files_of(one)}" for one in found[:_MOST_RECORDINGS]]
        told += f" Report them apart: {', then '.join(commands)}" + (" …" if len(found) > _MOST_RECORDINGS else "")
    echo(told, err=True)


def _files_of(recording: Recording) -> str:
    from nvscope.view.escape import visible

    first, last = (visible(shlex.quote(path)) for path in (recording.first, recording.last))
    return first if first == last else f"{first} … {last}"


def _tell_of_closed_files(infos: Sequence[SourceInfo]) -> None:
    """Say which closed files of a series of databases lie beside the one that was read, and were not."""
    from nvscope.capture.formats import DATABASES

    databases = [info.path for info in infos if info.format in DATABASES and not info.is_live]
    if not databases:
        return
    from nvscope.capture.datalogger.names import closed_files, number_of, series_of
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    read = {os.path.realpath(path) for path in databases}
    for series in dict.fromkeys(map(series_of, databases)):
        own = [(number_of(path), path) for path in databases if series_of(path) == series]
        numbers = [number for number, _ in own if number is not None]
        path = next((path for number, path in own if number is None), own[-1][1])
        beside = [
            other
            for number, other in closed_files(series)
            # Closed ones alone are a part of the series: it lacks what is between them.
            if os.path.realpath(other) not in read and (len(numbers) < len(own) or min(numbers) < number < max(numbers))
        ]
        if beside:
            told = f"{count_of(len(beside), 'closed file')} of its series beside it, such as {visible(beside[-1])}"
            what = "was not named, and is not read" if len(beside) == 1 else "were not named, and are not read"
            echo(f"nvscope: {visible(path)}: {told}, {what}.", err=True)


def tell_of_parts(known: NotWhole) -> None:
    """Say on stderr what of the captures could not be looked at."""
    for sentence in known.sentences():
        echo(f"nvscope: {sentence}", err=True)


def tell_of_losses(infos: Sequence[SourceInfo]) -> ExitCode:
    """Say on stderr which sources could not be read to their end, or lost something; return the exit code of that."""
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    for info in infos:
        if info.topics:
            told = visible(first_few(info.topics, _MOST_TOPICS))
            echo(f"nvscope: {visible(info.path)}: no packets are in it; its topics are {told}.", err=True)
        for note in info.notes:
            echo(f"nvscope: {visible(info.path)}: {visible(note)}.", err=True)
    _tell_of_closed_files(infos)
    failed = [info for info in infos if info.failure]
    for info in failed:
        echo(f"nvscope: {visible(info.path)}: {visible(info.failure)}; this is what came until then.", err=True)
    lossy = [info for info in infos if info.is_live and info.drops]
    for info in lossy:
        told = count_of(info.drops or 0, "frame")
        more = "; -B takes a larger buffer" if info.format == "interface" else ""
        echo(f"nvscope: {visible(info.path)}: {told} dropped while capturing{more}.", err=True)
    cut = [info for info in infos if info.truncation]
    for info in cut:
        assert info.truncation
        place = f"{visible(info.path)}, offset {info.truncation.offset}"
        echo(f"nvscope: {place}: {visible(info.truncation.message)}", err=True)
    return ExitCode.CAPTURE if failed else ExitCode.DATA_LOSS if cut or lossy else ExitCode.GOOD
