"""``nvscope diff``: what differs between two captures of a plant."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption
from nvscope.cli.encodings import as_data
from nvscope.cli.plant import plant_of
from nvscope.cli.sources import ChannelMapOption, tell_of_losses
from nvscope.cli.streams import refuse_streams_onto
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, width
from nvscope.errors import ExitCode, UsageError


def diff(
    a: Annotated[str, typer.Argument(metavar="A", help="Capture file, or directory, of how it was.")],
    b: Annotated[str, typer.Argument(metavar="B", help="Another one, of how it is now.")],
    as_json: Annotated[bool, typer.Option("--json", help="For programs (nvscope.captures-diff/1).")] = False,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Tell what differs between two captures: lists, senders, receivers, shapes, intervals, losses, causes.

    What differs by chance is not told: intervals are compared by a rank test, shares by their deviation. Exits with 0
    where nothing differs, with 1 where something does.
    """
    from nvscope.analysis.comparison import differences
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.formats import DATABASES, are_databases
    from nvscope.cli.progress import watching
    from nvscope.report import capture_difference as face
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    refuse_streams_onto([a, b])
    plant, ports = plant_of(project, gvl, [a, b], channel_map, decode)
    inquiries = [Inquiry([path], plant, ports, watch=watching(quiet=quiet)) for path in (a, b)]
    sides = [inquiry.analyze() for inquiry in inquiries]
    for path, side in zip((a, b), sides, strict=True):
        if are_databases(side.infos):
            raise UsageError(
                "rows of a database are not compared, only what was on a network", where=path,
                next_step="`nvscope export FILE.db -w values.csv` writes them for other programs",
            )  # fmt: skip
        if of_databases := sum(info.format in DATABASES for info in side.infos):
            told = count_of(of_databases, "database")
            echo(f"nvscope: {visible(path)}: rows are not compared: {told} left out.", err=True)
    found = differences(*sides)
    if as_json:
        from nvscope.report import json

        captures = [one.report(side)["capture"] for one, side in zip(inquiries, sides, strict=True)]
        as_data()
        echo(json.render(face.document(found, captures)), nl=False)
    else:
        shown = colour_wanted(colour)
        names = {key: entry.name for key, entry in plant.definition.by_key().items() if entry.name}
        echo(face.render(found, (a, b), names, colour=shown, width=width()), nl=False, color=shown)
    unread = [tell_of_losses(side.infos) for side in sides]
    if code := (ExitCode.ASSERTION_FAILED if found else max(unread)):
        raise typer.Exit(code)
