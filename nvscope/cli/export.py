"""``nvscope export``: values and telegrams to files for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from nvscope.cli.definitions import GvlOption, ProjectOption, project_of, tell_of_lists
from nvscope.cli.sources import (
    DecodeOption,
    FilterOption,
    ReadOption,
    SourcesArgument,
    chosen,
    port_rules,
    tell_of_losses,
)
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.analysis import Inquiry
    from nvscope.definition.layouts import Layouts
    from nvscope.definition.model import ListDefinition
    from nvscope.export.files import Files
    from nvscope.view.defined_telegrams import DefinedTelegrams, LeftOut
    from nvscope.view.fields import TelegramField
    from nvscope.view.telegrams import Telegrams

    Lists = list[tuple[tuple[int, int], ListDefinition]]

What = Literal["values", "telegrams"]
Form = Literal["wide", "long"]

_MOST_NAMED = 6


def export(
    sources: SourcesArgument = None,
    write: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--write",
            metavar="FILE",
            help="The file to write, in the format of its ending: .csv, .ndjson (.jsonl) or .parquet. One that exists "
            "is replaced.",
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
            help="wide, as without it: a row a telegram, a column a variable, a file a list. long: a row a variable "
            "and telegram, all lists in one file.",
        ),
    ] = None,
    listed: Annotated[
        list[str] | None,
        typer.Option("--list", metavar="LIST", help="Only this list: its name, identifier, or key as udp/1202/7."),
    ] = None,
    fields: Annotated[
        list[str] | None,
        typer.Option("-e", "--field", metavar="FIELD", help="A field of telegrams to write, such as nv.counter."),
    ] = None,
    wanted: FilterOption = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    quiet: Annotated[
        bool, typer.Option("-q", "--quiet", help="No progress bar; of the files, only what was left out.")
    ] = False,
) -> None:
    """Write the values of all telegrams, or the telegrams themselves, as CSV, NDJSON or Parquet.

    With several lists, the name of each stands in the name of its file: values.parquet becomes values.axis.parquet.
    What a telegram does not send is null. Files appear when they are complete. Exits with 3 where a capture could not
    be read to its end.
    """
    paths = chosen(sources, read)
    ports = port_rules(decode)
    if not write:
        raise UsageError("no file to write is named", next_step="add -w FILE.parquet, .csv or .ndjson")
    form_text = f"--form {form}" if form else "--list" if listed else ""
    wants_telegrams = what == "telegrams" or (fields is not None and what is None)
    if wants_telegrams and gvl and not (fields or wanted is not None):
        raise UsageError(
            "--gvl names variables, and of telegrams none is asked for",
            next_step="name them with -e var.NAME, filter by them with -Y, or leave --what out to write their values",
        )
    if fields and what == "values":
        raise UsageError("-e is for telegrams", next_step="add --what telegrams; --list chooses among values")

    from nvscope.analysis import Inquiry
    from nvscope.capture.open import open_source
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.cli.progress import ProgressBar, watching
    from nvscope.export.files import Files, format_of

    format_of(write)
    inquiry = Inquiry(paths, project_of(project, gvl), ports, watch=watching(quiet=quiet))
    layouts = None if wants_telegrams else inquiry.layouts
    lists: Lists = []
    if layouts is not None:
        lists = _chosen_lists(layouts, listed)
    elif not wants_telegrams and (what == "values" or form_text or gvl):
        raise UsageError("no list is defined", next_step="name the exported lists and their types with --gvl FILE")
    if not lists and form_text:
        raise UsageError(f"{form_text} is for values", next_step="leave it out, or leave out --what and -e")
    columns = [] if lists else _fields(fields or (), inquiry)
    filtered = None if wanted is None else inquiry.filter(wanted)

    keep_freed_memory()
    source = open_source(paths)
    files = Files()
    try:
        with ProgressBar(source, quiet=quiet) as progress:
            if lists:
                from nvscope.view.defined_telegrams import DefinedTelegrams
                from nvscope.view.display_filter import PacketChoice

                assert layouts is not None
                choose = PacketChoice(filtered) if filtered else None
                told = DefinedTelegrams(source, layouts, keys=[key for key, _ in lists], ports=ports, choose=choose)
                written = _write_values(told, lists, write, form or "wide", files, progress)
                fragments = told.fragments
            else:
                from nvscope.view.telegrams import Telegrams

                telegrams = Telegrams(source, ports=ports, chosen=filtered)
                _write_telegrams(telegrams, columns, write, files, progress)
                fragments = telegrams.fragments
        files.publish()
    except BaseException:
        files.discard()
        raise
    if lists:
        _tell_of_values(told, lists, written, write, quiet=quiet, all_lists=not listed)
        if not listed:
            tell_of_lists(inquiry)
    else:
        _tell_of_telegrams(telegrams, write)
    if fragments:
        from nvscope.units import count_of

        typer.echo(f"nvscope: {count_of(fragments, 'IP fragment')}, not put together.", err=True)
    if tell_of_losses(source.infos):
        raise typer.Exit(ExitCode.DATA_LOSS)


def _chosen_lists(layouts: Layouts, names: Sequence[str] | None) -> Lists:
    """Return the lists to be written, in the order of the definition; UsageError for a name that none has."""
    lists = [(key, entry) for key, entry in layouts.lists() if layouts.telegrams_of(*key)]
    if not lists:
        raise UsageError(
            "of no defined list is the size of all variables known", next_step="`nvscope gvl layout` shows why"
        )
    if not names:
        return lists
    from nvscope.definition.selection import lists_named

    found = {key for name in names for key, _ in lists_named(lists, name)}
    return [(key, entry) for key, entry in lists if key in found]


def _write_values(
    telegrams: DefinedTelegrams, lists: Lists, path: str, form: Form, files: Files, progress: Callable[[], None]
) -> list[tuple[str, int]]:
    """Write values; return the files with the number of telegrams in each."""
    from nvscope.export.values import paths_of, write_long, write_wide

    if form == "long":
        return [(path, write_long(telegrams, path, files, progress))]
    paths = paths_of(path, lists)
    return list(zip(paths, write_wide(telegrams, paths, files, progress), strict=True))


def _fields(names: Sequence[str], inquiry: Inquiry) -> Sequence[TelegramField]:
    from nvscope.view.fields import DEFAULT_FIELDS, output_field

    return [output_field(name, inquiry.fields) for name in names] or DEFAULT_FIELDS


def _write_telegrams(
    telegrams: Telegrams, fields: Sequence[TelegramField], path: str, files: Files, progress: Callable[[], None]
) -> None:
    from nvscope.export.files import format_of
    from nvscope.report.packets.records import Csv, JsonLines

    file = files.open(path)
    if format_of(path) == "parquet":
        from nvscope.export.files import table_file
        from nvscope.export.telegrams import TelegramTable

        table = TelegramTable(fields)
        table.open(table_file(file, table.schema))
        for rows in telegrams:
            table.add(rows)
            progress()
        table.finish()
        return
    face = Csv(fields) if format_of(path) == "csv" else JsonLines(fields)
    file.file.write(face.begin().encode())
    for rows in telegrams:
        for text in face.render(rows):
            file.file.write(text.encode())
        progress()
    file.file.write(face.end().encode())


def _tell_of_values(
    telegrams: DefinedTelegrams,
    lists: Lists,
    written: list[tuple[str, int]],
    path: str,
    *,
    quiet: bool,
    all_lists: bool,
) -> None:
    """Say what was written where several files were, and always what was not."""
    from nvscope.tracker.summary import list_key
    from nvscope.units import count_of
    from nvscope.view.defined_telegrams import LeftOut
    from nvscope.view.escape import visible

    def tell(text: str) -> None:
        typer.echo(f"nvscope: {text}", err=True)

    if not any(count for _, count in written):
        where = f"{visible(path)} has" if len(written) == 1 else f"the {len(written)} files have"
        tell(f"{count_of(telegrams.frames, 'frame')}, no telegram of a defined list; {where} columns, but no rows.")
    elif len(written) > 1 and not quiet:
        for name, count in written:
            tell(f"{visible(name)}: {count_of(count, 'telegram')}")
    names = dict(lists)
    left_out = telegrams.left_out
    for key, reasons in list(left_out.items())[:_MOST_NAMED]:
        tell(f"{list_key(*key)} {visible(names[key].name)}: {_left_out(reasons)}.")
    if others := list(left_out.values())[_MOST_NAMED:]:
        total = {reason: sum(reasons.get(reason, 0) for reasons in others) for reason in LeftOut}
        summed = {reason: count for reason, count in total.items() if count}
        tell(f"{count_of(len(others), 'more list')}: {_left_out(summed)}.")
    if telegrams.undefined and all_lists:
        tell(f"{count_of(telegrams.undefined, 'data telegram')} of lists without a definition left out.")


def _left_out(reasons: Mapping[LeftOut, int]) -> str:
    from nvscope.units import count, count_of

    words = {
        "MALFORMED": "malformed",
        "UNFITTING": "not of the shape that the definition has (NV405)",
        "CUT": "not captured whole",
    }
    if len(reasons) == 1:
        ((reason, number),) = reasons.items()
        return f"{count_of(number, 'telegram')} left out, {words[reason.name]}"
    told = ", ".join(f"{count(number)} {words[reason.name]}" for reason, number in reasons.items())
    return f"{count_of(sum(reasons.values()), 'telegram')} left out: {told}"


def _tell_of_telegrams(telegrams: Telegrams, path: str) -> None:
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    if telegrams.shown:
        return
    if telegrams.telegrams:
        what = f"the filter chooses none of {count_of(telegrams.telegrams, 'telegram')}"
    else:
        what = f"{count_of(telegrams.frames, 'frame')}, no telegram of network variables"
    typer.echo(f"nvscope: {what}; {visible(path)} has columns, but no rows.", err=True)
