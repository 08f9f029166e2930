"""``nvscope report``: lists, counters and findings of captures."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import typer
from msgspec.structs import replace

from nvscope.cli.completion import lists
from nvscope.cli.counts import at_least_one
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, NoNamesOption, ProjectOption, flaws_told_first, tell_of_lists
from nvscope.cli.encodings import as_data
from nvscope.cli.live import LiveOptions, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.secrets import SecretsOption, warn_of_secrets
from nvscope.cli.sources import (
    NOTHING_BETWEEN,
    BitRateOption,
    ChannelMapOption,
    FilterOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    duration_ns,
    tell_of_bit_rates,
    tell_of_channels,
    tell_of_gaps,
    tell_of_losses,
)
from nvscope.cli.terminal import ColourOption, WideOption, colour_wanted, echo, echo_all, tables_are_wide, width
from nvscope.errors import ExitCode, UsageError


@with_live_options
def report(
    live: LiveOptions,
    sources: SourcesArgument = None,
    read: ReadOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON (nvscope.report/2).")] = False,
    as_markdown: Annotated[bool, typer.Option("--md", help="Print the report as Markdown.")] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="Show the figures of lists and buses too, and the findings behind the causes.")
    ] = False,
    details: Annotated[
        bool,
        typer.Option(
            "-v",
            "--details",
            help="Show the same, the diagnosis structure and the streams of every list, and each finding by itself.",
        ),
    ] = False,
    timing: Annotated[
        bool, typer.Option("--timing", help="Draw how the intervals of each list are spread: two habits are no jitter.")
    ] = False,
    wide: WideOption = False,
    listed: Annotated[
        list[str] | None,
        typer.Option(
            "--list",
            metavar="LIST",
            help="Only this list: its name, identifier, or key as udp/1202/7; also several.",
            autocompletion=lists,
            show_default=False,
        ),
    ] = None,
    compare: Annotated[
        bool,
        typer.Option(
            "--compare",
            help="Compare variables that several lists have, such as on Ethernet and CAN, and those that a page of a "
            "web visualization showed with what the list carried: delays, differences.",
        ),
    ] = False,
    wanted: FilterOption = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    no_names: NoNamesOption = False,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    timeout: Annotated[
        str | None,
        typer.Option(
            "--ack-timeout",
            metavar="DURATION",
            help="How long an answer may take; 1s, unless the project says otherwise.",
            show_default=False,
        ),
    ] = None,
    bit_rates: BitRateOption = None,
    max_streams: Annotated[
        int | None,
        typer.Option(
            "--max-streams",
            metavar="NUMBER",
            parser=at_least_one,
            help="How many streams by sender, list and SubIndex are told apart, how many other kinds of telegrams, and "
            "how many identifiers on CAN; 50000, unless the project says otherwise. What is left out is told (NV906).",
            show_default=False,
        ),
    ] = None,
    fail_on: Annotated[
        Literal["note", "warning", "error", "never"],
        typer.Option("--fail-on", help="Exit with 1 where a cause or finding is shown that is at least so bad."),
    ] = "never",
    show_secrets: SecretsOption = False,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Tell what happened in a plant: a verdict, a strip of time for each list, and the causes, with what to do first.

    -Y chooses what is shown: lists, streams, nodes, findings and causes to which a chosen telegram belongs, with the
    figures of the whole capture, so that no filter makes up a loss. --from-time and --to-time cut the capture: only
    what lies between is judged. An interface is watched until --for is over, or Ctrl-C. Exits with 3 where a capture
    could not be read to its end, or lost frames.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    timeout_ns = None if timeout is None else duration_ns("--ack-timeout", timeout)
    if as_json and as_markdown:
        raise UsageError("--json and --md exclude each other", next_step="leave one of them out")
    if as_json and timing:
        raise UsageError(
            "--timing is drawn for people",
            next_step="leave it out: --json has intervals and percentiles of each stream",
        )

    asked = asked_range(from_time, to_time, utc=utc)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)
    plant = replace(plant, buses=plant.buses.overridden(bit_rates or ()))
    if max_streams is not None:
        plant = replace(plant, limits=dataclasses.replace(plant.limits, max_streams=max_streams))

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.cli.progress import watching

    inquiry = Inquiry(captured(paths, live, plant, ports), plant, ports, timeout_ns, watching(quiet=quiet), asked)
    if inquiry.paths:
        keep_freed_memory()
    with flaws_told_first(plant.definition):
        found = inquiry.analyze(wanted, values=True, compare=compare, causes=True, names=not no_names)
        document = inquiry.report(
            found, names=not no_names, values=as_json, drawn=True, listed=listed or (), secrets=show_secrets
        )  # fmt: skip
    warn_of_secrets(shown=show_secrets)
    shown = colour_wanted(colour)
    chronicle = found.happened.chronicle if found.happened else None
    shapes = None
    if timing:
        from nvscope.view.interval_shapes import IntervalShapes

        shapes = IntervalShapes(found.state, found.summary)
    if as_json:
        from nvscope.report import json

        as_data()
        parts = json.pieces(document)
    elif as_markdown:
        from nvscope.report import markdown

        parts = markdown.pieces(document, chronicle, shapes, utc=utc, everything=everything, details=details)
    else:
        from nvscope.report import text as face

        parts = face.pieces(
            document, chronicle, shapes, everything=everything, details=details, colour=shown, width=width(),
            wide=tables_are_wide(wide), utc=utc,
        )  # fmt: skip
    echo_all(parts, color=shown)
    tell_of_lists(inquiry)
    tell_of_channels(channel_map, [bus.channel for bus in found.summary.can.buses])
    tell_of_bit_rates(bit_rates, [bus.channel for bus in found.summary.can.buses])
    if fragments := found.state.capture.fragments:
        from nvscope.units import count_of

        told = count_of(fragments, "IP fragment")
        echo(f"nvscope: {told} counted but not put together.", err=True)
    if asked and not found.summary.capture.frames:
        echo(NOTHING_BETWEEN, err=True)
    tell_of_gaps(found.infos, found.summary.capture.start_ns, found.summary.capture.at_ns)
    unread = tell_of_losses(found.infos)
    if code := (ExitCode.ASSERTION_FAILED if _is_as_bad(document, fail_on) else unread):
        raise typer.Exit(code)


def _is_as_bad(document: Mapping[str, Any], least: str) -> bool:
    """Tell whether a report has a cause or a finding that is at least so bad."""
    if least == "never":
        return False
    from nvscope.findings.kind import Severity

    told = (*document["causes"], *document["findings"])
    return any(Severity.of(one["severity"]) >= Severity.of(least) for one in told)
