"""``nvscope export``: values and telegrams to files for other programs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from nvscope.analysis.read_values import read_source
from nvscope.cli import completion
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption, flaws_told_first, tell_of_lists
from nvscope.cli.exported_readings import (
    check_read_alone,
    meant_are_databases,
    nothing_defined,
    observed_readings,
    rows_of_databases,
    tell_of_exported_readings,
    tell_of_values_of_pages,
    write_read_alone,
)
from nvscope.cli.live import LiveOptions, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.secrets import SecretsOption, warn_of_secrets
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
    tell_of_channels,
    tell_of_losses,
    tell_of_parts,
)
from nvscope.cli.terminal import echo
from nvscope.errors import UsageError
from nvscope.extras import require

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.source import Source
    from nvscope.export.database_rows import DatabaseRows
    from nvscope.export.lists import Lists
    from nvscope.export.values import ReadOnes
    from nvscope.view.fields.field import TelegramField
    from nvscope.view.rows.defined import DefinedRows, DefinedTelegrams
    from nvscope.view.rows.frames import FrameRows, PacketRows
    from nvscope.whole_files import WholeFiles

What = Literal["values", "telegrams"]
Form = Literal["wide", "long"]
Rows = Literal["telegram", "cycle"]

Written = tuple[str, int, int]
"""The name of a file, how many telegrams are in it, and how many times that are null since no column holds them."""


@with_live_options
def export(
    live: LiveOptions,
    sources: SourcesArgument = None,
    write: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--write",
            metavar="FILE",
            help="The file to write, in the format of its ending: .csv, .ndjson (.jsonl) or .parquet; - is stdout as "
            "CSV, -.ndjson stdout as NDJSON. One that exists is replaced.",
            show_default=False,
        ),
    ] = None,
    read: ReadOption = None,
    what: Annotated[
        What | None,
        typer.Option(
            "--what", help="Values of variables, or telegrams with their headers; values, where lists are defined."
        ),
    ] = None,
    form: Annotated[
        Form | None,
        typer.Option(
            "--form",
            help="wide: a row a telegram, a column a variable, a file a list, as without it; with it, rows of "
            "databases are rows, too, in a file a table. long: a row a variable and telegram, all lists in one file.",
        ),
    ] = None,
    by: Annotated[
        Rows | None,
        typer.Option(
            "--rows",
            help="telegram, as without it. cycle: a row for telegrams that a sender sent together (rising SubIndexes, "
            "within half an interval, or 10 ms where none is defined), with the last value of every variable.",
        ),
    ] = None,
    listed: Annotated[
        list[str] | None,
        typer.Option(
            "--list",
            metavar="LIST",
            help="Only this list: its name, identifier, or key as udp/1202/7; visu/ADDRESS for what pages asked a "
            "controller for, db/FILE for a database.",
            autocompletion=completion.lists,
        ),
    ] = None,
    fields: Annotated[
        list[str] | None,
        typer.Option(
            "-e",
            "--field",
            metavar="FIELD",
            help="A field of telegrams to write, such as nv.counter.",
            autocompletion=completion.fields,
        ),
    ] = None,
    wanted: FilterOption = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    utc: Annotated[bool, typer.Option("--utc", help="Take --from-time and --to-time as UTC.")] = False,
    force: ForceOption = False,
    show_secrets: SecretsOption = False,
    channel_map: ChannelMapOption = None,
    quiet: Annotated[
        bool, typer.Option("-q", "--quiet", help="No progress bar; of the files, only what was left out.")
    ] = False,
) -> None:
    """Write the values of all telegrams, or the telegrams themselves, as CSV, NDJSON or Parquet.

    With several lists, the name of each stands in the name of its file: values.parquet becomes values.axis.parquet.
    Values of web visualization stand in the long form between those of lists; else a row a value in a file of their
    own, values.visu.parquet, which is there where pages asked for any. Passwords among them are hidden. So do values of
    DataLogger databases (values.db.parquet); with --form wide, rows of their tables are rows, a file a table. What a
    telegram does not send is null. Files appear when they are complete. Exits with 3 where a capture could not be read
    to its end.

    TIME, LTIME and times of day are durations: in Parquet by their type, elsewhere nanoseconds, in CSV and NDJSON with
    the unit in the name (tRun_ns), in the long form in the column integer. DATE, DT, LDATE and LDT are times without a
    zone, to the nanosecond (in the long form nanoseconds since 1970). Times beyond 292 years or the year 2262 are null
    and counted; the long form has them in the column unsigned. What nobody has described, such as a POINTER and all
    behind it, is bytes: in CSV and NDJSON hexadecimal digits. What is no number is NaN, inf or -inf in CSV, null in
    NDJSON.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    if not write:
        raise UsageError("no file to write is named", next_step="add -w FILE.parquet, .csv or .ndjson")
    if by == "cycle" and form == "long":
        raise UsageError("--rows cycle is for --form wide", next_step="the long form has a row a value; leave one out")
    form_text = f"--form {form}" if form else f"--rows {by}" if by else "--list" if listed else ""
    wants_telegrams = what == "telegrams" or (fields is not None and what is None)
    if wants_telegrams and gvl and not (fields or wanted is not None):
        raise UsageError(
            "--gvl names variables, and of telegrams none is asked for",
            next_step="name them with -e var.NAME, filter by them with -Y, or leave --what out to write their values",
        )
    if fields and what == "values":
        raise UsageError("-e is for telegrams", next_step="add --what telegrams; --list chooses among values")

    from nvscope.analysis.default_fields import default_fields
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.analysis.not_whole import NotWhole
    from nvscope.capture.formats import are_databases
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.cli.progress import watching
    from nvscope.export.files import format_of
    from nvscope.whole_files import WholeFiles

    format_of(write)
    require("export needs", "polars", "pyarrow")
    between = asked_range(from_time, to_time, utc=utc)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)
    inquiry = Inquiry(captured(paths, live, plant, ports), plant, ports, watch=watching(quiet=quiet), asked=between)
    layouts = None if wants_telegrams else inquiry.layouts
    lists: Lists = []
    of_read_ones = [name for name in listed or () if read_source(name)]
    source: Source | None = None
    wide: DatabaseRows | None = None
    if form == "wide" and inquiry.paths and not wants_telegrams:
        source = inquiry.open()
        wide = rows_of_databases(source, listed or (), plant.limits.max_streams)
    read_ones = None if wants_telegrams else observed_readings(listed or (), secrets=show_secrets, wide=wide)
    of_databases = False
    if read_ones is not None and layouts is None and not gvl and inquiry.paths:
        source = source or inquiry.open()
        of_databases = are_databases(source.infos)
    # Where no list is defined, telegrams are what is written, unless values are asked for, or there is nothing else.
    read_alone = read_ones is not None and (
        (layouts is None and (what == "values" or form == "long" or of_databases))
        or (bool(of_read_ones) and len(of_read_ones) == len(listed or ()))
    )
    with flaws_told_first(plant.definition):
        if read_alone:
            check_read_alone(form, by, only_databases=of_databases or meant_are_databases(listed or ()))
        elif layouts is not None:
            from nvscope.export.lists import lists_to_write

            lists = lists_to_write(layouts, [name for name in listed or () if name not in of_read_ones])
        elif not wants_telegrams and (what == "values" or form_text or gvl):
            if not plant.files:
                next_step = "name the exported lists and their types with --gvl FILE"
                raise UsageError("no list is defined", next_step=next_step)
            inquiry.defined_layouts()
        if not lists and form_text and not read_alone:
            raise UsageError(f"{form_text} is for values", next_step="leave it out, or leave out --what and -e")
        named = _fields(fields or (), inquiry)
        filtered = None if wanted is None else inquiry.filter(wanted)

    if inquiry.paths:
        keep_freed_memory()
    warn_of_secrets(shown=show_secrets)
    source, reading = source or inquiry.open(), inquiry.reading(filtered)
    columns = [] if lists or read_alone else named or default_fields(inquiry, source)
    inputs = [*(info.path for info in source.infos), *inquiry.project.inputs]
    files, parts = WholeFiles(inputs, force=force), NotWhole()
    try:
        with watching(quiet=quiet)(source) as progress:
            if read_alone:
                assert read_ones is not None
                frames = write_read_alone(inquiry, source, filtered, read_ones, write, files, wide, [parts])
                fragments = 0
                if not (read_ones.known or of_read_ones or of_databases):
                    raise nothing_defined(inquiry)
            elif lists:
                from nvscope.analysis.values import values
                from nvscope.view.rows.defined import DefinedTelegrams

                assert layouts is not None
                told = DefinedTelegrams(layouts, keys=[key for key, _ in lists])
                rows = values(source, reading, told, progress, [parts, *([read_ones] if read_ones else [])])
                row = "cycle" if by == "cycle" else form or "wide"
                written = _write_values(told, rows, lists, write, row, files, read_ones, wide)
                frames, fragments = told.frames, told.fragments
            else:
                from nvscope.analysis.packets import packets
                from nvscope.view.rows.frames import PacketRows

                telegrams = PacketRows()
                beyond = _write_telegrams(packets(source, reading, telegrams, progress, [parts]), columns, write, files)
                frames, fragments = telegrams.frames, telegrams.fragments
        files.publish()
    except BaseException:
        files.discard()
        raise
    if read_ones is not None:
        tell_of_exported_readings(
            read_ones, write, alone=read_alone, long=form == "long", secrets=show_secrets, quiet=quiet
        )  # fmt: skip
    if lists:
        _tell_of_values(
            told, written, write, "cycle" if by == "cycle" else "telegram", quiet=quiet, all_lists=not listed
        )
        if not listed:
            tell_of_lists(inquiry)
    elif not read_alone:
        _tell_of_telegrams(telegrams, beyond, write)
        if what is None and not named and not quiet and any(one.name.startswith("visu.") for one in columns):
            tell_of_values_of_pages(write)
    tell_of_channels(channel_map, source.channels)
    tell_of_parts(parts)
    if between and not frames:
        echo(NOTHING_BETWEEN, err=True)
    if fragments:
        from nvscope.units import count_of

        echo(f"nvscope: {count_of(fragments, 'IP fragment')}, not put together.", err=True)
    if code := tell_of_losses(source.infos):
        raise typer.Exit(code)


def _write_values(
    telegrams: DefinedTelegrams,
    rows: Iterable[DefinedRows],
    lists: Lists,
    path: str,
    form: Form | Rows,
    files: WholeFiles,
    read_ones: ReadOnes | None,
    wide: DatabaseRows | None,
) -> list[Written]:
    from nvscope.export.part_names import path_of_part
    from nvscope.export.values import ReadFiles, paths_of, write_long, write_wide
    from nvscope.whole_files import Existing, is_stdout

    if form == "long":
        return [(path, write_long(telegrams, rows, path, files, read_ones), 0)]
    paths = paths_of(path, lists)
    beside = None
    if read_ones is not None and not is_stdout(path):
        beside_of = {name: path_of_part(path, name) for name in read_ones.makes}
        beside = ReadFiles(beside_of, files, read_ones, Existing.KEPT, wide)
    told = write_wide(telegrams, rows, paths, files, by_cycle=form == "cycle", read_ones=beside)
    return [(name, count, beyond) for name, (count, beyond) in zip(paths, told, strict=True)]


def _fields(names: Sequence[str], inquiry: Inquiry) -> Sequence[TelegramField]:
    from nvscope.view.fields.frame import output_field

    return [output_field(name, inquiry.fields) for name in names]


def _write_telegrams(
    pieces: Iterable[FrameRows], fields: Sequence[TelegramField], path: str, files: WholeFiles
) -> int:  # fmt: skip
    """Write fields of telegrams, and return how many times in them no column of times holds."""
    from nvscope.export.files import format_of
    from nvscope.report.packets.records import Csv, JsonLines
    from nvscope.view.fields.field import times_beyond

    file = files.open(path)
    if format_of(path) == "parquet":
        from nvscope.export.files import table_file
        from nvscope.export.telegrams import TelegramTable

        table = TelegramTable(fields)
        table.open(table_file(file, table.schema))
        for rows in pieces:
            table.add(rows)
        table.finish()
        return table.beyond_time
    face = Csv(fields) if format_of(path) == "csv" else JsonLines(fields)
    beyond = 0
    file.file.write(face.begin().encode())
    for rows in pieces:
        for text in face.render(rows):
            file.file.write(text.encode())
        beyond += times_beyond(fields, rows)
    file.file.write(face.end().encode())
    return beyond


def _tell_of_values(
    telegrams: DefinedTelegrams, written: list[Written], path: str, row: str, *, quiet: bool, all_lists: bool
) -> None:
    """Say what was written where several files were, and always what was not; a ``row`` is of a telegram or cycle."""
    from nvscope.export.unwritten import ASSUMED_PACKING, beyond_time, left_out, no_part_of_cycles, why_nothing
    from nvscope.list_key import Transport
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    def tell(text: str) -> None:
        echo(f"nvscope: {text}", err=True)

    if not any(count for _, count, _ in written):
        where = f"{visible(path)} has" if len(written) == 1 else f"the {len(written)} files have"
        tell(f"{why_nothing(telegrams)}; {where} columns, but no rows.")
    elif len(written) > 1 and not quiet:
        for name, count, _ in written:
            tell(f"{visible(name)}: {count_of(count, row)}")
    for name, _, beyond in written:
        if beyond:
            tell(f"{visible(name)}: {beyond_time(beyond)}")
    if not quiet and any(key.transport is Transport.CAN for key in telegrams.keys):
        echo(f"nvscope: {ASSUMED_PACKING}", err=True)
    for sentence in [*(no_part_of_cycles(telegrams) if row == "cycle" else []), *left_out(telegrams)]:
        tell(sentence)
    if telegrams.undefined and all_lists:
        tell(f"{count_of(telegrams.undefined, 'data telegram')} of lists without a definition left out.")


def _tell_of_telegrams(telegrams: PacketRows, beyond: int, path: str) -> None:
    from nvscope.export.unwritten import beyond_time
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    if beyond:
        echo(f"nvscope: {visible(path)}: {beyond_time(beyond)}", err=True)
    if telegrams.shown:
        return
    if telegrams.telegrams:
        what = f"the filter chooses none of {count_of(telegrams.telegrams, 'telegram')}"
    else:
        what = f"{count_of(telegrams.frames, 'frame')}, no telegram of network variables"
    echo(f"nvscope: {what}; {visible(path)} has columns, but no rows.", err=True)
