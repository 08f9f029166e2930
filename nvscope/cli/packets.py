"""``nvscope packets``: the telegrams of captures, one by one."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from nvscope.cli.completion import fields as fields_beginning
from nvscope.cli.counts import at_least_one
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import (
    GvlOption,
    NoNamesOption,
    ProjectOption,
    flaws_told_first,
    tell_of_lists,
    tell_of_missing,
)
from nvscope.cli.encodings import as_data
from nvscope.cli.live import LiveOptions, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.secrets import SecretsOption, warn_of_secrets
from nvscope.cli.sources import (
    NOTHING_BETWEEN,
    ChannelMapOption,
    FilterOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    tell_of_channels,
    tell_of_losses,
    tell_of_parts,
)
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, width
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source
    from nvscope.definition.parameters import Parameters
    from nvscope.definition.pdos import Pdos
    from nvscope.engine.run import Observer
    from nvscope.report.packets.records import Face
    from nvscope.tracker.can.canopen_since import CanOpenSince
    from nvscope.view.display_filter import DisplayFilter
    from nvscope.view.fields.field import TelegramField

Format = Literal["text", "fields", "json", "ndjson", "csv"]
Moment = Literal["a", "ad", "d", "e", "r", "u", "ud"]

_LEAST_WIDTH = 40

_MOMENT_HELP = (
    "How times are told: r since the first frame, d since the telegram before, a local time of day, ad with the date, "
    "u, ud the same in UTC, e seconds since 1970."
)


@with_live_options
def packets(
    live: LiveOptions,
    sources: SourcesArgument = None,
    read: ReadOption = None,
    trees: Annotated[
        bool, typer.Option("-V", "--tree", help="Show every field of every layer instead of a line.")
    ] = False,
    dumps: Annotated[bool, typer.Option("-x", "--hex", help="Show the captured bytes too.")] = False,
    output: Annotated[
        Format | None,
        typer.Option("-T", "--format", help="What to write: text for people, as without it, or one for programs."),
    ] = None,
    fields: Annotated[
        list[str] | None,
        typer.Option(
            "-e",
            "--field",
            metavar="FIELD",
            help="A field to write, such as nv.counter; -T fields if no -T.",
            autocompletion=fields_beginning,
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "-E", metavar="NAME=VALUE", help="For -T fields: header=y|n, separator=/t|/s|CHARACTER, quote=d|s|n."
        ),
    ] = None,
    wanted: FilterOption = None,
    all_frames: Annotated[
        bool,
        typer.Option(
            "--all-frames",
            help="Show frames of all kinds, ARP, ICMP, TCP and others too; so without it where -Y or -e names a field "
            "that only these have, such as icmp.type.",
        ),
    ] = False,
    count: Annotated[
        int | None,
        typer.Option(
            "-c",
            "--count",
            parser=at_least_one,
            metavar="N",
            help="Stop after reading N telegrams (with --all-frames: frames), shown or not.",
        ),
    ] = None,
    moment: Annotated[Moment, typer.Option("-t", "--time", help=_MOMENT_HELP)] = "r",
    write: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--write",
            metavar="FILE",
            help="Show nothing, and write the frames to a capture: .pcapng, .mcap, .pcap, or .log for CAN. One that "
            "exists is replaced.",
            show_default=False,
        ),
    ] = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    no_names: NoNamesOption = False,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    show_secrets: SecretsOption = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
    wide: Annotated[bool, typer.Option("--wide", help="Whole lines, however wide the terminal is.")] = False,
) -> None:
    """Show the telegrams of a capture one by one: as lines, trees, bytes, or as records for programs.

    A line has frame number, time, sender and receiver, list and SubIndex, service, items, Length, Counter, flags, and
    what is wrong; of a CAN frame it is as candump writes it, with what it means. -Y chooses among them. With
    --all-frames every frame has a line; a filter such as -Y 'icmp.type == 3' or -Y arp finds its frames without being
    told so. --from-time and --to-time cut the capture: frame numbers and times since the start are those of what is
    left, as in a report with the same times; a time without a zone is local, with -t u or ud UTC. Exits with 3 where a
    capture could not be read to its end.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    if write is not None and (shown := _shown(output, trees, dumps, fields, settings, count)):
        raise UsageError(f"{shown}: of what is shown, and -w shows nothing", next_step="leave one of them out")
    records = output is not None and output != "text"
    between = asked_range(from_time, to_time, utc=moment in ("u", "ud"))
    asked = trees or wanted is not None or bool(fields) or records or between is not None or write is not None

    plant, ports = plant_of(project, gvl, paths, channel_map, decode)
    from nvscope.definition.defined_pdos import pdos_of

    pdos = pdos_of(plant.definition)
    if gvl and not (trees or wanted is not None or fields or pdos or write):
        raise UsageError(
            "--gvl names variables in trees (-V), filters (-Y) and fields (-e)",
            next_step="add one of them; `nvscope vars` shows last values",
        )
    from nvscope.capture.formats import are_databases, why_no_row
    from nvscope.cli.progress import watching

    captures = captured(paths, live, plant, ports)
    inquiry = None
    if asked or captures is not paths:
        from nvscope.analysis.inquiry import Inquiry
        from nvscope.protocols.table import PROTOCOLS
        from nvscope.protocols.visu import with_secrets

        protocols = with_secrets(PROTOCOLS) if show_secrets else PROTOCOLS
        inquiry = Inquiry(captures, plant, ports, watch=watching(quiet=quiet), asked=between, protocols=protocols)
    named = []
    with flaws_told_first(plant.definition):
        if inquiry and fields:
            from nvscope.view.fields.frame import output_field

            named = [output_field(name, inquiry.fields, all_frames=True) for name in fields]
        chosen_by = None
        if inquiry and wanted is not None:
            chosen_by = inquiry.filter(wanted, all_frames=True, names=not no_names)
    if inquiry and write is not None:
        _write(inquiry, write, chosen_by, all_frames=all_frames, quiet=quiet)
        return
    all_frames |= any(field.of_others for field in named) or bool(chosen_by and chosen_by.of_others)
    from nvscope.protocols.visu import page_ports
    from nvscope.tracker.can.canopen_since import CanOpenSince

    warn_of_secrets(shown=show_secrets)
    canopen = CanOpenSince(pdos.cob_ids if pdos else ())
    make = _face(
        output, trees, dumps, named, settings or (), moment, colour_wanted(colour),
        {} if no_names else plant.node_names, inquiry, plant.definition.parameters, pdos, canopen,
        all_frames=all_frames, wide=wide, secrets=show_secrets, page_ports=page_ports(plant.webvisu),
    )  # fmt: skip

    from nvscope import units
    from nvscope.analysis.not_whole import NotWhole
    from nvscope.analysis.packets import packets as read_packets
    from nvscope.analysis.reading import reading_of
    from nvscope.analysis.seen_lists import SeenLists
    from nvscope.capture.open import open_source
    from nvscope.view.fields.field import rows_cut, times_beyond
    from nvscope.view.rows.frames import PacketRows

    beyond, cut = 0, dict.fromkeys((field.name for field in named if field.cut), 0)
    source = inquiry.open() if inquiry else open_source(paths, renamed=plant.channels)
    face = make(source)
    if inquiry:
        reading = inquiry.reading(chosen_by, all_frames=all_frames)
    else:
        reading = reading_of(plant, ports, pdos, all_frames=all_frames)
    telegrams = PacketRows(limit=count)
    seen = SeenLists() if inquiry and plant.files and count is None else None
    parts = NotWhole() if chosen_by else None
    others: list[Observer] = [canopen, *([seen] if seen else []), *([parts] if parts else [])]
    out = sys.stdout
    with watching(quiet=quiet or out.isatty())(source) as progress:
        out.write(face.begin())
        for rows in read_packets(source, reading, telegrams, progress, others):
            for text in face.render(rows):
                out.write(text)
            out.flush()
            beyond += times_beyond(named, rows)
            for field in named:
                if field.cut:
                    cut[field.name] += rows_cut(field, rows)
        out.write(face.end())
        out.flush()
    if count is None:
        tell_of_channels(channel_map, source.channels)
    if between and not telegrams.frames:
        echo(NOTHING_BETWEEN, err=True)
    elif not telegrams.telegrams and telegrams.frames:
        frames = units.count_of(telegrams.frames, "frame")
        echo(
            f"nvscope: {frames}, no telegram of network variables; `nvscope report` tells what to check, --all-frames "
            "shows the frames.",
            err=True,
        )
    elif not telegrams.telegrams:
        infos = source.infos
        what = why_no_row(infos) if are_databases(infos) else "0 frames, no telegram of network variables"
        echo(f"nvscope: {what}; `nvscope report` tells what to check.", err=True)
    elif not telegrams.shown:
        of_rows = "row" if are_databases(source.infos) else "frame" if telegrams.has_others else "telegram"
        read_count = units.count_of(telegrams.telegrams, "frame" if all_frames else of_rows)
        of_any = count is None and chosen_by and chosen_by.of_any_frame
        left = telegrams.frames - telegrams.telegrams if of_any else 0
        more = f" --all-frames looks at {units.count_of(left, 'other frame')} too." if left else ""
        none = "does not choose it" if telegrams.telegrams == 1 else "chooses none of them"
        echo(f"nvscope: {read_count} read, the filter {none}.{more}", err=True)
    elif chosen_by and (chosen_by.findings or chosen_by.causes):
        what = "finding" if not chosen_by.causes else "finding or cause" if chosen_by.findings else "cause"
        echo(f"nvscope: a {what} is shown by the telegrams of its first ten events, not by all.", err=True)
    if telegrams.fragments:
        echo(f"nvscope: {units.count_of(telegrams.fragments, 'IP fragment')}, not put together.", err=True)
    if parts:
        tell_of_parts(parts)
    if beyond:
        from nvscope.export.unwritten import beyond_time

        echo(f"nvscope: {beyond_time(beyond, '`nvscope export --form long`')}", err=True)
    for name, frames_cut in cut.items():
        if frames_cut:
            from nvscope.view.fields.visu_variable import MOST_VARIABLES

            verb = "frame has" if frames_cut == 1 else "frames have"
            echo(
                f"nvscope: {units.count(frames_cut)} {verb} more than {MOST_VARIABLES} times {name}: the first ones "
                "that differ are told; -V shows all.",
                err=True,
            )
    if inquiry and plant.files:
        tell_of_lists(inquiry)
    if inquiry and seen:
        tell_of_missing(inquiry, seen)
    if code := tell_of_losses(source.infos):
        raise typer.Exit(code)


def _shown(
    output: str | None, trees: bool, dumps: bool, fields: Sequence[str] | None, settings: Sequence[str] | None,
    count: int | None,
) -> str:  # fmt: skip
    """Return the options that were given of what is shown, '' for none."""
    told = {"-T": output, "-V": trees, "-x": dumps, "-e": fields, "-E": settings, "-c": count}
    return ", ".join(name for name, value in told.items() if value)


def _write(inquiry: Inquiry, path: str, chosen: DisplayFilter | None, *, all_frames: bool, quiet: bool) -> None:
    """Write the chosen frames to a capture; without a filter, all of them."""
    from nvscope.cli.frame_files import write_frames
    from nvscope.record.attachments import attachments_of

    source, plant = inquiry.open(), inquiry.project
    attachments = [*attachments_of(plant.inputs, plant.path), *source.attachments]
    write_frames(inquiry, source, path, chosen, attachments, all_frames=all_frames, quiet=quiet)
    if code := tell_of_losses(source.infos):
        raise typer.Exit(code)


def _face(
    output: Format | None,
    trees: bool,
    dumps: bool,
    named: Sequence[TelegramField],
    settings: Sequence[str],
    moment: Moment,
    colour: bool,
    node_names: Mapping[str, str],
    inquiry: Inquiry | None,
    parameters: Parameters | None,
    pdos: Pdos | None,
    canopen: CanOpenSince,
    *,
    all_frames: bool,
    wide: bool,
    secrets: bool,
    page_ports: Collection[int],
) -> Callable[[Source], Face]:
    """Return what makes the form that was asked for; UsageError where options contradict each other."""
    chosen_format = output or ("fields" if named else "text")
    if chosen_format != "text" and (trees or dumps):
        raise UsageError(
            f"-V and -x are for text, not for -T {chosen_format}", next_step="take udp.payload for all bytes"
        )
    if chosen_format in ("json", "ndjson"):
        as_data()
    if settings and chosen_format != "fields":
        raise UsageError("-E is for -T fields", next_step="add -T fields -e FIELD, or leave -E out")
    if chosen_format == "text":
        if named:
            raise UsageError("-e is not for -T text", next_step="write -T fields, json, ndjson or csv")
        from nvscope.report.packets.text import Text

        layouts = inquiry.layouts if trees and inquiry else None
        text = Text(
            trees=trees, dumps=dumps, moment=moment, width=None if wide else _line_width(), colour=colour,
            layouts=layouts, names=node_names, pdos=pdos, canopen=canopen,
            parameters=parameters, secrets=secrets,
            page_ports=page_ports,
        )  # fmt: skip
        return lambda _: text

    from nvscope.report.packets.records import Csv, JsonArray, JsonLines, SeparatedFields, separation

    if chosen_format == "fields":
        if not named:
            raise UsageError(
                "-T fields needs to know which fields", next_step="for example -e frame.number -e nv.counter"
            )
        separated = SeparatedFields(named, separation(settings))
        return lambda _: separated
    assert inquiry
    from nvscope.analysis.default_fields import default_fields

    made: dict[str, Callable[[Sequence[TelegramField]], Face]] = {"csv": Csv, "json": JsonArray, "ndjson": JsonLines}
    record = made[chosen_format]
    return lambda source: record(named or default_fields(inquiry, source, all_frames=all_frames))


def _line_width() -> int | None:
    """Return the columns of the terminal; None where stdout is none, since nothing is to be cut for programs."""
    return max(width(), _LEAST_WIDTH) if sys.stdout.isatty() else None
