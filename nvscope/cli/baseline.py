"""``nvscope baseline``: rules that good captures teach, as a file that people edit."""

from __future__ import annotations

from typing import Annotated

import typer
from msgspec.structs import replace

from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption, flaws_told_first
from nvscope.cli.frame_files import no_file_named
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.sources import (
    NOTHING_BETWEEN,
    BitRateOption,
    ChannelMapOption,
    ForceOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    duration_ns,
    tell_of_losses,
)
from nvscope.cli.terminal import echo
from nvscope.errors import UsageError
from nvscope.whole_files import is_stdout

_ENDING = ".rules.toml"


def baseline(
    sources: SourcesArgument = None,
    write: Annotated[
        str | None,
        typer.Option(
            "-w", "--write", metavar="FILE.rules.toml", show_default=False,
            help="The file of rules to write; one that exists stays, for somebody may have edited it.",
        ),
    ] = None,
    read: ReadOption = None,
    warmup: Annotated[
        str, typer.Option("--warmup", metavar="DURATION", help="Nothing is learnt, nor judged, before.")
    ] = "0s",
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    bit_rates: BitRateOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    utc: Annotated[bool, typer.Option("--utc", help="Take --from-time and --to-time as UTC.")] = False,
    force: ForceOption = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress, and no word at the end.")] = False,
) -> None:  # fmt: skip
    """Learn rules for check from captures of a plant that works: what was so, and limits with some room.

    Each rule says what was seen, and how sure that makes it. What is in the captures is taken for good: read the file
    before anybody relies on it. Captures are read twice.
    """
    named = named_files(sources, read, gvl)
    paths, gvl = named.captures, named.definitions
    if not write:
        raise no_file_named("-w FILE.rules.toml")
    if not (write.endswith(_ENDING) or is_stdout(write)):
        raise UsageError(f"{write}: files of rules end with {_ENDING}", next_step="so check finds them by themselves")
    warmup_ns = duration_ns("--warmup", warmup, least_ns=0)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)
    plant = replace(plant, buses=plant.buses.overridden(bit_rates or ()))
    asked = asked_range(from_time, to_time, utc=utc)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.capture.open import files_of
    from nvscope.check.learning import learn
    from nvscope.check.learnt_file import text
    from nvscope.cli.progress import watching
    from nvscope.units import count_of
    from nvscope.view.escape import visible
    from nvscope.whole_files import Existing, WholeFiles

    inquiry = Inquiry(paths, plant, ports, watch=watching(quiet=quiet), asked=asked)
    files = WholeFiles([*files_of(paths), *plant.inputs], force=force)
    try:
        out = files.open(write, Existing.KEPT).file
        with flaws_told_first(plant.definition):
            lesson = learn(inquiry, warmup_ns)
        if not lesson.lists:
            if asked:
                echo(NOTHING_BETWEEN, err=True)
            raise UsageError("there is no telegram to learn from", next_step="see nvscope doctor FILE")
        out.write(text(lesson, paths, warmup_ns).encode())
        files.publish()
    finally:
        files.discard()
    for told in lesson.left_out:
        echo(f"nvscope: not learnt: {visible(told)}", err=True)
    if not quiet:
        thin = sum(one.thin for one in lesson.rules)
        rules = count_of(len(lesson.rules), "rule")
        weak = f"; {thin} of them from so little that they are warnings" if thin else ""
        echo(f"nvscope: {rules} of {count_of(lesson.lists, 'list')} in {visible(write)}{weak}", err=True)
    if code := tell_of_losses(lesson.infos):
        raise typer.Exit(code)
