"""What verbs share that send: where it goes, how it ends, and what is said of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec import Struct

from nvscope.capture.live.can.word import PREFIX
from nvscope.cli.terminal import echo
from nvscope.enumeration import first_few
from nvscope.errors import ExitCode, UsageError
from nvscope.view.escape import visible

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.capture.source import Source, SourceInfo
    from nvscope.plc.can_sender import CanRoute, CanSender
    from nvscope.plc.pace import Pace, Timing
    from nvscope.plc.telegram_sender import Route, TelegramSender

_TARGET = re.compile(r"udp://(?P<address>\[[^\]]*\]|[^:/\[\]]*)(?::(?P<port>[0-9]{1,5}))?")
_MOST_PORT = 0xFFFF
_MOST_TARGETS = 5

MapOption = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="OLD=NEW",
        help="Send to NEW what went to the address OLD, or what was on the CAN channel OLD; also several.",
        show_default=False,
    ),
]
PortOption = Annotated[
    list[str] | None,
    typer.Option(
        "--port", metavar="[OLD=]NEW", help="Send to port NEW what went to port OLD, or all of it.", show_default=False
    ),
]
ToOption = Annotated[
    str | None,
    typer.Option(
        "--to",
        metavar="TARGET",
        help="Send the telegrams to udp://ADDRESS:PORT, or the frames of CAN to can:INTERFACE:CHANNEL. "
        "Without an address, telegrams go to where they went; without a port, to the port they went to.",
        show_default=False,
    ),
]
NetworkOption = Annotated[
    bool, typer.Option("--allow-network", help="Send to other machines, too, and not to this one alone.")
]


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


class Target(Struct, frozen=True):
    """What ``--to`` and the options beside it say: where telegrams go, or on which buses frames of CAN."""

    route: Route | CanRoute

    @property
    def is_can(self) -> bool:
        """Whether frames of CAN are sent, and not telegrams."""
        from nvscope.plc.can_sender import CanRoute

        return isinstance(self.route, CanRoute)

    def sender(self, pace: Pace, ports: PortRules | None, is_stopped: Callable[[], bool]) -> CanSender | TelegramSender:
        """Return what sends there."""
        from nvscope.plc.can_sender import CanRoute, CanSender
        from nvscope.plc.telegram_sender import TelegramSender

        if isinstance(self.route, CanRoute):
            return CanSender(self.route, pace, is_stopped)
        return TelegramSender(self.route, pace, ports, is_stopped)


def target_of(to: str, mapped: Sequence[str], ports: Sequence[str], *, allow_network: bool) -> Target:
    """Return where to send by the options; UsageError where they cannot be understood, or it may not be sent there."""
    if to.startswith(PREFIX):
        if ports:
            raise UsageError("--port is of telegrams", next_step="leave it out where --to is a CAN bus")
        return Target(_buses_of(to, mapped, allow_network=allow_network))
    return Target(_route_of(to, mapped, ports, allow_network=allow_network))


def _buses_of(to: str, mapped: Sequence[str], *, allow_network: bool) -> CanRoute:
    from nvscope.plc.can_sender import CanRoute

    words = {}
    for text in mapped:
        name, sign, word = text.partition("=")
        if not sign or not name or not word.startswith(PREFIX):
            raise UsageError(
                f"--map {text[:80]}: expected CHANNEL=can:INTERFACE:CHANNEL",
                next_step="for example --map can0=can:socketcan:vcan1",
            )
        words[name] = word
    return CanRoute(to, words, allow_network)


def _route_of(to: str, mapped: Sequence[str], ports: Sequence[str], *, allow_network: bool) -> Route:
    """Return where telegrams go by the options; UsageError where they cannot be understood, or may not go there."""
    from nvscope.plc.permission import address_of
    from nvscope.plc.telegram_sender import Route

    found = _TARGET.fullmatch(to)
    if found is None or (found["port"] and not 0 < int(found["port"]) <= _MOST_PORT):
        raise UsageError(
            f"--to {to[:80]}: expected udp://ADDRESS:PORT, or can:INTERFACE:CHANNEL",
            next_step="for example udp://127.0.0.1:1202, or can:socketcan:vcan0",
        )
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


def tell_of_sent(
    target: Target, timing: Timing, sender: CanSender | TelegramSender, *, quiet: bool = False
) -> ExitCode:
    """Say what was sent, and how late; and what was not, with the exit code for that."""
    from nvscope.units import count_of, duration

    noun = "frame" if target.is_can else "telegram"
    targets = list(sender.targets)
    if quiet:
        pass
    elif not timing.sent:
        others = "frame of CAN" if target.is_can else "telegram over UDP"
        instead = "telegrams are sent with --to udp://…" if target.is_can else "frames of CAN are with --to can:…"
        echo(f"nvscope: nothing was sent: no {others} is in the time that was asked for; {instead}.", err=True)
    else:
        told = f"nvscope: {count_of(timing.sent, noun)} sent"
        if timing.p50_ns is not None and timing.p99_ns is not None and timing.worst_ns is not None:
            told += f" to {visible(first_few(targets, _MOST_TARGETS))}; late by {duration(timing.p50_ns)} (p50), "
            told += f"{duration(timing.p99_ns)} (p99), {duration(timing.worst_ns)} (worst)"
        echo(f"{told}.", err=True)
    for remark in () if quiet else sender.remarks():
        echo(f"nvscope: {visible(remark)}.", err=True)
    if not sender.cut:
        return ExitCode.GOOD
    echo(f"nvscope: {count_of(sender.cut, noun)} not captured whole, and not sent.", err=True)
    return ExitCode.DATA_LOSS
