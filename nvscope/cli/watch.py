"""``nvscope watch``: what happens in a plant, while it happens; on a screen, or line by line."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from nvscope.capture.content import STDIN
from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, NoNamesOption, ProjectOption, flaws_told_first, tell_of_lists
from nvscope.cli.encodings import as_data
from nvscope.cli.limits import file_limits
from nvscope.cli.live import LiveOptions, captured, with_live_options
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.scenes import scenes
from nvscope.cli.screen import RING_MIB, SIGNALLED, RingOption, ThemeOption, clock, has_screen
from nvscope.cli.sources import (
    ChannelMapOption,
    FilterOption,
    FromTimeOption,
    ReadOption,
    SourcesArgument,
    ToTimeOption,
    asked_range,
    duration_ns,
    tell_of_losses,
)
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, width
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.analysis.news import Told
    from nvscope.analysis.watching import Scene, Watching

_EVERY_NS = 10_000_000_000


@with_live_options
def watch(
    live: LiveOptions,
    sources: SourcesArgument = None,
    read: ReadOption = None,
    plain: Annotated[
        bool, typer.Option("--plain", help="No screen: a table from time to time, and causes as they begin and end.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="No screen: a line of JSON a second (nvscope.watch/1).")
    ] = False,
    every: Annotated[
        str | None,
        typer.Option("--every", metavar="DURATION", help="With --plain, a table so often; 10s.", show_default=False),
    ] = None,
    switch: Annotated[
        list[str] | None,
        typer.Option(
            "-b", "--ring-buffer", metavar="WHAT:N",
            help="What the screen records is one file after the other: each of duration:N seconds, packets:N, or "
            "filesize:N kB; of more than files:N, the oldest is removed.",
            show_default=False,
        ),
    ] = None,
    ring: RingOption = RING_MIB,
    wanted: FilterOption = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    no_names: NoNamesOption = False,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    from_time: FromTimeOption = None,
    to_time: ToTimeOption = None,
    theme: ThemeOption = None,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress on stderr.")] = False,
    colour: ColourOption = "auto",
) -> None:  # fmt: skip
    """Watch lists, causes, variables, packets and nodes of a plant while it runs, or of a capture as its time moves.

    On a terminal it is a screen: 1 to 7 choose a view, ? shows all keys; where stdin is the capture, too. Where stdout
    is no terminal it is what --plain prints. What it says at a moment is what a report on the same packets says. Exits
    as a report does.
    """
    files_named = named_files(sources, read, gvl, live.interfaces)
    paths, gvl = files_named.captures, files_named.definitions
    if plain and as_json:
        raise UsageError("--plain and --json exclude each other", next_step="leave one of them out")
    rule = file_limits(switch or ())
    asked = asked_range(from_time, to_time, utc=utc)
    every_ns = _EVERY_NS if every is None else duration_ns("--every", every)
    plant, ports = plant_of(project, gvl, paths, channel_map, decode)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.analysis.watching import Watching
    from nvscope.cli.memory import keep_freed_memory

    screen = not (plain or as_json) and has_screen(paths)
    captures = captured(paths, live, plant, ports)
    inquiry = Inquiry(captures, plant, ports, asked=asked)
    if inquiry.paths:
        keep_freed_memory()
    # Whoever watches was there, and plain lines begin with the time; programs, and captures, have the words of reports.
    by_clock = captures is not paths or STDIN in paths if screen else not as_json
    how = Watching(ring << 20, {} if no_names else None, clock=clock(utc) if by_clock else None)
    if screen:
        from nvscope.record.attachments import attachments_of
        from nvscope.record.circumstances import circumstances_of
        from nvscope.record.file_series import FileRule
        from nvscope.record.recorded_topics import RecordedTopics
        from nvscope.record.recorder import Beside, Recorder
        from nvscope.tui.run import run_screen
        from nvscope.view.escape import visible
        from nvscope.view.lines.plant.source_blocks import recorded_in_words

        recorder = Recorder(
            Beside(
                lambda: () if isinstance(captures, Sequence) else captures.channels,
                attachments_of(plant.inputs, plant.path),
                lambda: circumstances_of(() if isinstance(captures, Sequence) else captures.infos, live.bpf),
                RecordedTopics.of(plant.definition, inquiry.layouts),
            ),
            FileRule(rule.get("duration"), rule.get("packets"), rule.get("filesize"), rule.get("files")),
        )
        if captures is not paths or STDIN in paths:
            how = replace(how, others=[recorder])
        with flaws_told_first(plant.definition):
            left = run_screen(inquiry, how, recorder, expression=wanted, theme=theme, utc=utc, colour=colour)
        if left.signal == getattr(signal, "SIGHUP", None):
            raise typer.Exit(SIGNALLED + left.signal)  # nobody is there any more to be told anything
        code = ExitCode.GOOD
        if (state := recorder.state) is not None:
            told = recorded_in_words(state.frames, state.files, state.path)
            echo(f"nvscope: {told}{': ' if state.failure else '.'}{visible(state.failure)}", err=True)
            code = ExitCode.CAPTURE if state.failure else ExitCode.GOOD
        if code := max(tell_of_losses(left.infos), code):
            raise typer.Exit(code)
        return
    if wanted is not None:
        raise UsageError("-Y chooses what the screen shows", next_step="leave it out; a report shows what it chooses")
    if theme is not None:
        raise UsageError("--theme is of the screen", next_step="leave it out; --color is of what is printed")
    if rule:
        raise UsageError("-b is of what the screen records", next_step="leave it out; the screen records with R")
    with flaws_told_first(plant.definition):
        last = _printed(inquiry, as_json, every_ns, how, quiet=quiet, colour=colour_wanted(colour), utc=utc)
    if plant.files:
        tell_of_lists(inquiry)
    if code := tell_of_losses(last.snapshot.infos):
        raise typer.Exit(code)


def _printed(
    inquiry: Inquiry, as_json: bool, every_ns: int, how: Watching, *, quiet: bool, colour: bool, utc: bool
) -> Scene:  # fmt: skip
    """Print what is watched until its end; return what is known then."""
    from nvscope.analysis.news import News

    printer: _Json | _Plain = _Json() if as_json else _Plain(every_ns, colour=colour, utc=utc)
    if as_json:
        as_data()
    news, last = News(), None
    for last in scenes(inquiry, how, quiet=quiet or sys.stdout.isatty()):
        assert last.snapshot.happened
        told = news.of(last.snapshot.happened.causes)
        if text := printer.text(last, told):
            echo(text, nl=False, color=colour)
    assert last is not None
    if text := printer.end(last):
        echo(text, nl=False, color=colour)
    return last


class _Json:
    """A line a second, schema ``nvscope.watch/1``."""

    def text(self, scene: Scene, told: Told) -> str:
        import json

        from nvscope.analysis.transactions.rows import pair_rows
        from nvscope.view.documents.watch import watch_line
        from nvscope.view.escape import json_ascii

        known = scene.snapshot
        per_s = {key: scene.pace.per_second(number, 1) for number, key in scene.list_keys.items()}
        line = watch_line(
            scene.document, known.summary, scene.at_ns, per_s, scene.pace.of_all(1), told.new, told.ended, told.instead,
            pair_rows(scene.document, scene.transactions, 1),
        )  # fmt: skip
        return json_ascii(json.dumps(line, ensure_ascii=False)) + "\n"

    def end(self, scene: Scene) -> str:
        return ""


class _Plain:
    """A table from time to time, and what begins and ends when it does."""

    def __init__(self, every_ns: int, *, colour: bool, utc: bool) -> None:
        self._every_ns = every_ns
        self._colour, self._utc = colour, utc
        self._due_ns: int | None = None
        self._shown_ns: int | None = None

    def text(self, scene: Scene, told: Told) -> str:
        from nvscope.report import watch as face

        at_ns = scene.at_ns
        text = face.news(told, at_ns, colour=self._colour, width=width(), utc=self._utc)
        if at_ns is None or not (scene.document["lists"] or scene.transactions.numbers):
            return text
        left_ns = 0 if self._due_ns is None else self._due_ns - at_ns
        if not 0 < left_ns <= self._every_ns:  # more is left where the clock was set back
            self._due_ns = at_ns + self._every_ns
            text += self._table(scene)
        return text

    def end(self, scene: Scene) -> str:
        return "" if self._shown_ns is not None and scene.at_ns == self._shown_ns else self._table(scene)

    def _table(self, scene: Scene) -> str:
        from nvscope.analysis.transactions.rows import pair_rows
        from nvscope.report import watch as face

        self._shown_ns = scene.at_ns
        chronicle = scene.chronicle and scene.chronicle.last(face.STRIP_NS)
        return face.table(
            scene.document, chronicle, pair_rows(scene.document, scene.transactions), per_s=scene.pace.of_all(),
            colour=self._colour, width=width(), utc=self._utc,
        )  # fmt: skip
