"""``nvscope packets``: the telegrams of captures, one by one."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from nvscope.cli.definitions import GvlOption
from nvscope.cli.sources import DecodeOption, ReadOption, SourcesArgument, chosen, port_rules, tell_of_losses
from nvscope.cli.terminal import ColourOption, colour_wanted, width
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from dissectors.batch import Bool
    from nvscope.definition.layouts import Layouts
    from nvscope.report.packets.records import Face
    from nvscope.view.display_filter import DisplayFilter

Format = Literal["text", "fields", "json", "ndjson", "csv"]
Moment = Literal["a", "ad", "d", "e", "r", "u", "ud"]

_LEAST_WIDTH = 40

_MOMENT_HELP = (
    "How times are told: r since the first frame, d since the telegram before, a local time of day, ad with the date, "
    "u, ud the same in UTC, e seconds since 1970."
)


def packets(
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
            "-e", "--field", metavar="FIELD", help="A field to write, such as nv.counter; -T fields if no -T."
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "-E", metavar="NAME=VALUE", help="For -T fields: header=y|n, separator=/t|/s|CHARACTER, quote=d|s|n."
        ),
    ] = None,
    wanted: Annotated[
        str | None,
        typer.Option(
            "-Y",
            "--filter",
            metavar="EXPR",
            help="Show only telegrams for which it holds, such as 'nv.index == 7 && nv.flags.ack'; in Wireshark's "
            "syntax, over the fields of `nvscope keys --fields`.",
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option("-c", "--count", min=1, metavar="N", help="Stop after reading N telegrams, shown or not."),
    ] = None,
    moment: Annotated[Moment, typer.Option("-t", "--time", help=_MOMENT_HELP)] = "r",
    gvl: GvlOption = None,
    decode: DecodeOption = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Show the telegrams of a capture one by one: as lines, trees, bytes, or as records for programs.

    A line has frame number, time, sender and receiver, list and SubIndex, service, items, Length, Counter, flags, and
    what is wrong. -Y chooses among them. Exits with 3 where a capture could not be read to its end.
    """
    paths = chosen(sources, read)
    ports = port_rules(decode)
    face = _face(output, trees, dumps, fields or (), settings or (), moment, colour_wanted(colour), gvl)

    chosen_by = _display_filter(wanted)

    from nvscope import units
    from nvscope.capture.open import open_source
    from nvscope.cli.progress import ProgressBar
    from nvscope.view.telegrams import TelegramRows, Telegrams

    source = open_source(paths)
    out = sys.stdout
    with ProgressBar(source, quiet=quiet or out.isatty()) as progress:

        def choose(rows: TelegramRows) -> Bool:
            progress()  # where nothing is shown, nothing else moves the bar
            assert chosen_by
            return chosen_by(rows)

        telegrams = Telegrams(source, ports=ports, limit=count, chosen=choose if chosen_by else None)
        out.write(face.begin())
        for rows in telegrams:
            for text in face.render(rows):
                out.write(text)
            out.flush()
            progress()
        out.write(face.end())
        out.flush()
    if not telegrams.telegrams:
        frames = units.count_of(telegrams.frames, "frame")
        typer.echo(
            f"nvscope: {frames}, no telegram of network variables; `nvscope report` tells what to check.", err=True
        )
    elif not telegrams.shown:
        read_count = units.count_of(telegrams.telegrams, "telegram")
        typer.echo(f"nvscope: {read_count} read, the filter chooses none of them.", err=True)
    if telegrams.fragments:
        typer.echo(f"nvscope: {units.count_of(telegrams.fragments, 'IP fragment')}, not put together.", err=True)
    if tell_of_losses(source.infos):
        raise typer.Exit(ExitCode.DATA_LOSS)


def _layouts(gvl: Sequence[str] | None) -> Layouts | None:
    if not gvl:
        return None
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.load import load_definitions

    return Layouts(load_definitions(gvl))


def _display_filter(text: str | None) -> DisplayFilter | None:
    if text is None:
        return None
    from nvscope.view.display_filter import DisplayFilter

    return DisplayFilter(text)


def _face(
    output: Format | None,
    trees: bool,
    dumps: bool,
    names: Sequence[str],
    settings: Sequence[str],
    moment: Moment,
    colour: bool,
    gvl: Sequence[str] | None,
) -> Face:
    """Return the form that was asked for; UsageError where options contradict each other."""
    if gvl and not trees:
        raise UsageError("--gvl names the variables in trees", next_step="add -V; `nvscope vars` shows last values")
    chosen_format = output or ("fields" if names else "text")
    if chosen_format != "text" and (trees or dumps):
        raise UsageError(
            f"-V and -x are for text, not for -T {chosen_format}", next_step="take udp.payload for all bytes"
        )
    if settings and chosen_format != "fields":
        raise UsageError("-E is for -T fields", next_step="add -T fields -e FIELD, or leave -E out")
    if chosen_format == "text":
        if names:
            raise UsageError("-e is not for -T text", next_step="write -T fields, json, ndjson or csv")
        from nvscope.report.packets.text import Text

        layouts = _layouts(gvl) if trees else None
        return Text(trees=trees, dumps=dumps, moment=moment, width=_line_width(), colour=colour, layouts=layouts)

    from nvscope.report.packets.records import Csv, JsonArray, JsonLines, SeparatedFields, separation
    from nvscope.view.fields import DEFAULT_FIELDS, find_field

    if chosen_format == "fields":
        if not names:
            raise UsageError(
                "-T fields needs to know which fields", next_step="for example -e frame.number -e nv.counter"
            )
        return SeparatedFields([find_field(name) for name in names], separation(settings))
    fields = [find_field(name) for name in names] or DEFAULT_FIELDS
    if chosen_format == "csv":
        return Csv(fields)
    return JsonArray(fields) if chosen_format == "json" else JsonLines(fields)


def _line_width() -> int | None:
    """Return the columns of the terminal; None where stdout is none, since nothing is to be cut for programs."""
    return max(width(), _LEAST_WIDTH) if sys.stdout.isatty() else None
