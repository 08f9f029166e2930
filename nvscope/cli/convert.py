"""``nvscope convert``: captures to another format, whole or in part."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption, flaws_told_first, tell_of_flaws
from nvscope.cli.frame_files import no_file_named, write_frames
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.sources import (
    NOTHING_BETWEEN,
    ChannelMapOption,
    FilterOption,
    ForceOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    tell_of_losses,
)
from nvscope.cli.terminal import echo


def convert(
    sources: SourcesArgument = None,
    write: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--write",
            metavar="FILE",
            help="The file to write, in the format of its ending: .mcap, .pcapng, .pcap, or .log for CAN. One that "
            "exists is replaced.",
            show_default=False,
        ),
    ] = None,
    read: ReadOption = None,
    wanted: FilterOption = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    utc: Annotated[bool, typer.Option("--utc", help="Take --from-time and --to-time as UTC.")] = False,
    force: ForceOption = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress, and no word at the end.")] = False,
) -> None:
    """Write captures in another format: pcap, pcapng, MCAP, or candump logs; several become one timeline.

    Bytes, lengths and times to the nanosecond stay as they are. What the format cannot hold, such as names of
    interfaces in a pcap, is told; where it cannot hold the frames, nothing is written. -Y, --from-time and --to-time
    choose frames. An .mcap file gets the definitions of --gvl, or of the project, too. Exits with 3 where a capture
    could not be read to its end.
    """
    files_named = named_files(sources, read, gvl)
    paths, gvl = files_named.captures, files_named.definitions
    if not write:
        raise no_file_named("-w FILE.mcap, .pcapng, .pcap, or .log")
    asked = asked_range(from_time, to_time, utc=utc)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.progress import watching
    from nvscope.record.attachments import attachments_of

    inquiry = Inquiry(paths, plant, ports, watch=watching(quiet=quiet), asked=asked)
    with flaws_told_first(plant.definition):
        chosen = None if wanted is None else inquiry.filter(wanted, all_frames=True)
    tell_of_flaws(plant.definition)
    source = inquiry.open()
    attachments = [*attachments_of(plant.inputs, plant.path), *source.attachments]
    write_frames(inquiry, source, write, chosen, attachments, force=force, quiet=quiet)
    if asked and not any(info.frames for info in source.infos):
        echo(NOTHING_BETWEEN, err=True)
    if code := tell_of_losses(source.infos):
        raise typer.Exit(code)
