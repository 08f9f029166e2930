"""``nvscope replay``: a capture as it happened, on the screen, or its telegrams to a network, at their pace."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from msgspec import Struct

from nvscope.capture.content import STDIN
from nvscope.capture.player import LEAST_RATE, MOST_RATE
from nvscope.capture.streams import is_stream
from nvscope.cli.decode_as import DecodeOption, port_rules
from nvscope.cli.definitions import GvlOption, NoNamesOption, ProjectOption, flaws_told_first
from nvscope.cli.named_files import named_files
from nvscope.cli.plant import plant_of
from nvscope.cli.screen import RING_MIB, SIGNALLED, RingOption, ThemeOption, clock, has_screen
from nvscope.cli.sending import MapOption, NetworkOption, PortOption, Stop, Target, ToOption, target_of, tell_of_sent
from nvscope.cli.sources import (
    ChannelMapOption,
    FilesArgument,
    FilterOption,
    ReadOption,
    asked_range,
    tell_of_losses,
)
from nvscope.cli.terminal import ColourOption
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.definition.project import Project

LEAST_SENT_RATE, MOST_SENT_RATE = 0.01, 1000.0
_RANGE = ("--start-offset", "--until")


def replay(
    sources: FilesArgument = None,
    to: ToOption = None,
    read: ReadOption = None,
    rate: Annotated[
        float, typer.Option("--rate", metavar="FACTOR", help="How many times as fast as it was; 0.1 is slow.")
    ] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end, until it is ended.")] = False,
    start: Annotated[
        str | None,
        typer.Option("--start-offset", metavar="TIME", help="Begin at this time of the capture.", show_default=False),
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="TIME", help="End at this time of it.", show_default=False)
    ] = None,
    skip_gaps: Annotated[
        bool, typer.Option("--skip-gaps", help="A pause of more than a second lasts one second.")
    ] = False,
    mapped: MapOption = None,
    port: PortOption = None,
    allow_network: NetworkOption = False,
    wanted: FilterOption = None,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    no_names: NoNamesOption = False,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    ring: RingOption = RING_MIB,
    theme: ThemeOption = None,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No word of what was sent, and how late.")] = False,
    colour: ColourOption = "auto",
) -> None:  # fmt: skip
    """Play a capture on the screen of `nvscope watch`, as it happened, slower or faster; or send its telegrams again.

    On the screen space stands still, . and , go a frame on and back, [ and ] some seconds, { and } to the cause before
    and the next one, < and > change the rate, a repeats a part; ? shows all keys.

    With --to each telegram is sent when it is due by one clock: a plant on a desk. To this machine alone, unless
    --allow-network is given. There each sender has an address of its own, 127.168.1.10 for 192.168.1.10, so that a
    program that listens tells them apart. Malformed telegrams are sent as they are; those that were not captured whole
    are not, and the exit code is 3. At the end it says how late telegrams were sent.
    """
    how = How(rate, loop, start, until, skip_gaps)
    if to:
        if wanted is not None or theme is not None or gvl:
            raise UsageError("-Y, --theme and --gvl are of the screen", next_step="leave them out where --to sends")
        files = named_files(sources, read)
        target = target_of(to, mapped or (), port or (), allow_network=allow_network)
        how.check(LEAST_SENT_RATE, MOST_SENT_RATE)
        send(files.captures, how, target, port_rules(decode), quiet=quiet)
        return
    if mapped or port or allow_network:
        raise UsageError("it is not said where to send", next_step="add --to udp://127.0.0.1")
    files = named_files(sources, read, gvl)
    how.check(LEAST_RATE, MOST_RATE)
    plant, ports = plant_of(project, files.definitions, files.captures, channel_map, decode)
    show(
        files.captures, how, plant, ports, wanted=wanted, names=not no_names, ring_mib=ring, theme=theme,
        utc=utc, colour=colour,
    )  # fmt: skip


class How(Struct, frozen=True):
    """How a capture is replayed: so many times as fast, again at its end, from a time on, to a time, without pauses."""

    rate: float
    loops: bool
    start: str | None
    until: str | None
    skips_gaps: bool

    def check(self, least: float, most: float) -> None:
        """UsageError for a rate that is not between two."""
        if not least <= self.rate <= most:
            raise UsageError(f"--rate {self.rate:g}: expected {least:g} to {most:g}", next_step="for example --rate 2")


def send(captures: Sequence[str], how: How, target: Target, ports: PortRules | None, *, quiet: bool) -> None:
    """Send what captures hold, and say how late it was."""
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.live import LiveRun
    from nvscope.definition.project import Project
    from nvscope.plc.pace import Pace

    inquiry = Inquiry(captures, Project(), ports, asked=asked_range(how.start, how.until, utc=False, options=_RANGE))
    if how.loops and (once := inquiry.read_once):
        raise UsageError(f"--loop: {once} cannot be sent again", next_step="name a file instead")
    pace, source = Pace(how.rate, skips_gaps=how.skips_gaps), inquiry.open()
    stop = Stop(source)
    with LiveRun(stop, quiet=True), target.sender(pace, ports, lambda: stop.asked) as sender:
        while not stop.asked:
            for batch in source:
                sender.send(batch, source.channels)
            if not how.loops or not pace.timing.sent:
                break
            pace.again()
            source = inquiry.open()
            stop.source = source
    code = tell_of_sent(target, pace.timing, sender, quiet=quiet)
    if code := max(tell_of_losses(source.infos), code):
        raise typer.Exit(code)


def show(
    captures: Sequence[str], how: How, plant: Project, ports: PortRules | None, *, wanted: str | None, names: bool,
    ring_mib: int, theme: str | None, utc: bool, colour: Literal["auto", "always", "never"],
) -> None:  # fmt: skip
    """Play captures on the screen until somebody ends it."""
    if not has_screen(captures):
        raise UsageError(
            "there is no terminal to show it on",
            next_step="`nvscope watch --plain FILE` tells what happened, line by line; --to udp://127.0.0.1 sends it",
        )
    for path in filter(is_stream, captures):
        told = "stdin" if path == STDIN else "a pipe"
        raise UsageError(f"{told} cannot be played: it is read once", next_step="name a file")
    asked = asked_range(how.start, how.until, utc=utc, options=_RANGE)
    from msgspec.structs import replace

    from nvscope.analysis.extent import span_of
    from nvscope.analysis.inquiry import Inquiry
    from nvscope.analysis.watching import Watching
    from nvscope.capture.player import Player
    from nvscope.capture.source import FileSource
    from nvscope.cli.memory import keep_freed_memory
    from nvscope.record.recorder import Recorder
    from nvscope.tui.run import run_screen

    player = Player(how.rate, skips_gaps=how.skips_gaps, loops=how.loops)
    whole = Inquiry(captures, plant, ports, asked=None if asked is None else replace(asked, start=None))
    keep_freed_memory()
    if asked is not None and asked.start is not None:
        source = Inquiry(captures, plant, ports).open()
        assert isinstance(source, FileSource)
        begin_ns, _ = span_of(source, asked, lambda: whole.latest_ns(asked.told_from_end))
        source.stop()
        if begin_ns is not None:
            player.go(begin_ns)
    watching = Watching(ring_mib << 20, None if names else {}, clock=clock(utc))
    with flaws_told_first(plant.definition):
        left = run_screen(
            whole, watching, Recorder(), expression=wanted, theme=theme, utc=utc, colour=colour, player=player
        )  # fmt: skip
    if left.signal == getattr(signal, "SIGHUP", None):
        raise typer.Exit(SIGNALLED + left.signal)  # nobody is there any more to be told anything
    if code := tell_of_losses(left.infos):
        raise typer.Exit(code)
