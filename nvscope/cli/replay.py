"""``nvscope replay``: the telegrams of a recording to a network, at their pace."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.cli.named_files import named_files
from nvscope.cli.sources import (
    DecodeOption,
    ReadOption,
    SourcesArgument,
    asked_range,
    port_rules,
    tell_of_losses,
)
from nvscope.cli.terminal import echo
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.capture.source import Source, SourceInfo
    from nvscope.plc.pace import Timing
    from nvscope.plc.telegram_sender import Route

_LEAST_RATE, _MOST_RATE = 0.01, 1000.0
_TARGET = re.compile(r"udp://(?P<address>\[[^\]]*\]|[^:/\[\]]*)(?::(?P<port>[0-9]{1,5}))?")
_MOST_PORT = 0xFFFF

MapOption = Annotated[
    list[str] | None,
    typer.Option(
        "--map", metavar="OLD=NEW", help="Send to NEW what went to the address OLD; also several.", show_default=False
    ),
]
PortOption = Annotated[
    list[str] | None,
    typer.Option(
        "--port", metavar="[OLD=]NEW", help="Send to port NEW what went to port OLD, or all of it.", show_default=False
    ),
]
NetworkOption = Annotated[
    bool, typer.Option("--allow-network", help="Send to other machines, too, and not to this one alone.")
]


def replay(
    sources: SourcesArgument = None,
    to: Annotated[
        str | None,
        typer.Option(
            "--to",
            metavar="udp://ADDRESS[:PORT]",
            help="Where telegrams go; without an address, where they went; without a port, to the port they went to.",
            show_default=False,
        ),
    ] = None,
    read: ReadOption = None,
    rate: Annotated[
        float, typer.Option("--rate", metavar="FACTOR", help="How many times as fast as it was; 0.1 is slow.")
    ] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end, until Ctrl-C.")] = False,
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
    decode: DecodeOption = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No word of what was sent, and how late.")] = False,
) -> None:
    """Send the telegrams of a capture again, each when it is due by one clock: a plant on a desk.

    To this machine alone, unless --allow-network is given. There each sender has an address of its own, 127.168.1.10
    for 192.168.1.10, so that a program that listens tells them apart. Malformed telegrams are sent as they are; those
    that were not captured whole are not, and the exit code is 3. At the end it says how late telegrams were sent.
    """
    if not to:
        raise UsageError(
            "it is not said where to send", next_step="add --to udp://127.0.0.1; `nvscope watch FILE` shows a capture"
        )
    route = route_of(to, mapped or (), port or (), allow_network=allow_network)
    if not _LEAST_RATE <= rate <= _MOST_RATE:
        raise UsageError(f"--rate {rate}: expected {_LEAST_RATE} to {_MOST_RATE:.0f}", next_step="for example --rate 2")
    files = named_files(sources, read)
    asked = asked_range(start, until, utc=False)

    from nvscope.analysis.inquiry import Inquiry
    from nvscope.cli.live import LiveRun
    from nvscope.definition.project import Project
    from nvscope.plc.pace import Pace
    from nvscope.plc.telegram_sender import TelegramSender

    inquiry = Inquiry(files.captures, Project(), port_rules(decode), asked=asked)
    pace, source = Pace(rate, skips_gaps=skip_gaps), inquiry.open()
    stop = Stop(source)
    with LiveRun(stop, quiet=True), TelegramSender(route, pace, port_rules(decode), lambda: stop.asked) as sender:
        while not stop.asked:
            for batch in source:
                sender.send(batch)
            if not loop or not pace.timing.sent:
                break
            pace.again()
            source = inquiry.open()
            stop.source = source
    if not quiet:
        tell_of_sent(pace.timing, sender.targets)
    if sender.cut:
        from nvscope.units import count_of

        echo(f"nvscope: {count_of(sender.cut, 'telegram')} not captured whole, and not sent.", err=True)
    if code := max(tell_of_losses(source.infos), ExitCode.DATA_LOSS if sender.cut else ExitCode.GOOD):
        raise typer.Exit(code)


class Stop:
    """What ends when somebody asks for it: what is sent, and the source of that, if it has one."""

    def __init__(self, source: Source | None = None) -> None:
        self.source = source
        self.asked = False

    @property
    def infos(self) -> Sequence[SourceInfo]:
        return () if self.source is None else self.source.infos

    def stop(self) -> None:
        self.asked = True
        if self.source is not None:
            self.source.stop()


def route_of(to: str, mapped: Sequence[str], ports: Sequence[str], *, allow_network: bool) -> Route:
    """Return where telegrams go by the options; UsageError where they cannot be understood, or may not go there."""
    from nvscope.plc.permission import address_of
    from nvscope.plc.telegram_sender import Route

    found = _TARGET.fullmatch(to)
    if found is None or (found["port"] and not 0 < int(found["port"]) <= _MOST_PORT):
        raise UsageError(f"--to {to[:80]}: expected udp://ADDRESS:PORT", next_step="for example udp://127.0.0.1:1202")
    addresses = {}
    for text in mapped:
        old, sign, new = text.partition("=")
        if not sign:
            raise UsageError(
                f"--map {text[:80]}: expected OLD=NEW", next_step="for example --map 192.168.1.255=127.0.0.1"
            )
        addresses[address_of(old.strip())] = address_of(new.strip())
    every, numbers = int(found["port"] or 0), {}
    for text in ports:
        old, sign, new = text.rpartition("=")
        parts = [part for part in (old, new) if part or sign]
        if not all(part.isdecimal() and part.isascii() and 0 < int(part) <= _MOST_PORT for part in parts):
            raise UsageError(f"--port {text[:80]}: expected NEW, or OLD=NEW", next_step="for example --port 1202=2202")
        if sign:
            numbers[int(old)] = int(new)
        else:
            every = int(new)
    address = address_of(found["address"]) if found["address"] else ""
    return Route(address, every, addresses, numbers, allow_network)


def tell_of_sent(timing: Timing, targets: Mapping[tuple[str, int], int]) -> None:
    """Say what was sent, and how late."""
    from nvscope.units import count_of, duration

    where = ", ".join(f"{address}:{port}" for address, port in list(targets)[:5])
    more = f" and {len(targets) - 5} more" if len(targets) > 5 else ""
    if not timing.sent:
        echo("nvscope: nothing was sent: no telegram over UDP is there; frames of CAN are not sent.", err=True)
        return
    told = f"nvscope: {count_of(timing.sent, 'telegram')} sent"
    if timing.p50_ns is not None and timing.p99_ns is not None and timing.worst_ns is not None:
        told += f" to {where}{more}; late by {duration(timing.p50_ns)} (p50), {duration(timing.p99_ns)} (p99), "
        told += f"{duration(timing.worst_ns)} (worst)"
    echo(f"{told}.", err=True)
