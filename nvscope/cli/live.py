"""The options by which verbs are told of live sources, and what a verb does while it reads one."""

from __future__ import annotations

import inspect
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Annotated, Any, Protocol, Self, get_type_hints

import typer
from msgspec import Struct

from nvscope.cli.limits import limits
from nvscope.cli.sources import duration_ns
from nvscope.cli.terminal import echo
from nvscope.errors import UnreadableInput, UsageError

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.capture.source import Source, SourceInfo
    from nvscope.definition.project import Project

_MEGABYTE = 1 << 20
_STATUS_S = 1.0
_MOST_NAMES = 8
_INTERFACE = re.compile(r"[\w@:-]{1,15}", re.ASCII)

InterfaceOption = Annotated[
    list[str] | None,
    typer.Option(
        "-i",
        "--interface",
        metavar="NAME",
        help="Capture on an interface, by its name or its number of -D; also several.",
        show_default=False,
    ),
]


def _list_interfaces(wanted: bool) -> None:
    if wanted:
        from nvscope.cli.interface_list import print_interfaces

        print_interfaces()
        raise typer.Exit


ListOption = Annotated[
    bool,
    typer.Option(
        "-D",
        "--list-interfaces",
        callback=_list_interfaces,
        is_eager=True,
        help="List interfaces, and the CAN channels that drivers find, and do nothing else.",
    ),
]
ForOption = Annotated[
    str | None,
    typer.Option("--for", metavar="DURATION", help="End a live source, or stdin, after this time.", show_default=False),
]
AutostopOption = Annotated[
    list[str] | None,
    typer.Option(
        "-a",
        "--autostop",
        metavar="WHAT:N",
        help="End a live source after duration:N seconds, packets:N, or filesize:N kB of packets.",
        show_default=False,
    ),
]
FollowOption = Annotated[
    bool,
    typer.Option("--follow", help="Go on reading a capture that is still written, like tail -f, until it is ended."),
]
BpfOption = Annotated[
    str | None,
    typer.Option(
        "-f",
        "--capture-filter",
        metavar="BPF",
        help="What interfaces let in, in the language of tcpdump; '' for everything. Without it: the ports of the "
        "project, telegrams on any other port, TCP of WebVisu, fragments, ICMP and ARP.",
        show_default=False,
    ),
]
BufferOption = Annotated[
    float | None,
    typer.Option(
        "-B",
        "--buffer-size",
        metavar="MIB",
        help="The kernel's buffer of an interface.",
        show_default="64; 128 above 1 Gbit/s",
    ),
]
PromiscuousOption = Annotated[
    bool, typer.Option("-p", "--no-promiscuous-mode", help="Leave out frames that are for other stations.")
]


class LiveOptions(Struct, frozen=True):
    """What was asked of live sources."""

    interfaces: Sequence[str] = ()
    duration: str | None = None
    autostop: Sequence[str] = ()
    bpf: str | None = None
    buffer_mib: float | None = None
    not_promiscuous: bool = False
    follow: bool = False

    @property
    def asked(self) -> list[str]:
        """The options that were given, and mean nothing without a live source."""
        told = {"--for": self.duration, "-a": self.autostop}
        return [name for name, value in told.items() if value] + self.of_interfaces

    @property
    def of_interfaces(self) -> list[str]:
        """The options that were given, and mean nothing without an interface."""
        told = {"-f": self.bpf is not None, "-B": self.buffer_mib, "-p": self.not_promiscuous}
        return [name for name, value in told.items() if value]


def with_live_options(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the options of live sources; it takes them as one, ``live``."""

    def taking(
        *,
        interface: InterfaceOption = None,
        duration: ForOption = None,
        autostop: AutostopOption = None,
        bpf: BpfOption = None,
        buffer_mib: BufferOption = None,
        not_promiscuous: PromiscuousOption = False,
        follow: FollowOption = False,
        list_interfaces: ListOption = False,
        **others: Any,
    ) -> None:
        live = LiveOptions(interface or (), duration, autostop or (), bpf, buffer_mib, not_promiscuous, follow)
        verb(live=live, **others)

    hints = get_type_hints(taking, include_extras=True)
    options = [
        one.replace(annotation=hints[name])
        for name, one in inspect.signature(taking, follow_wrapped=False).parameters.items()
        if name != "others"
    ]
    hints = get_type_hints(verb, include_extras=True)
    kept = [
        one.replace(kind=one.KEYWORD_ONLY, annotation=hints[name])
        for name, one in inspect.signature(verb).parameters.items()
        if name != "live"
    ]
    taking.__signature__ = inspect.Signature([*kept, *options])  # type: ignore[attr-defined]
    taking.__annotations__ = {one.name: one.annotation for one in (*kept, *options)}
    taking.__name__, taking.__doc__, taking.__module__ = verb.__name__, verb.__doc__, verb.__module__
    return taking


def captured(
    paths: Sequence[str], live: LiveOptions, plant: Project, ports: PortRules | None
) -> Sequence[str] | Source:
    """Return the captures as they were named, or, where these are live sources, as one that is open.

    UnreadableInput for a word that names nothing, UsageError where live sources and files are mixed, or options given
    that mean nothing without one.
    """
    from nvscope.capture.live.open import is_live
    from nvscope.capture.streams import is_stream

    if live.follow:
        return _followed(paths, live, plant)
    words = [*map(_named, live.interfaces), *(path for path in paths if is_live(path))]
    files = [path for path in paths if not is_live(path)]
    for path in files:
        _look_for(path)
    if not words:
        if len(files) == 1 and is_stream(files[0]) and live.asked and not live.of_interfaces:
            return _streamed(files[0], live, plant)
        if asked := live.asked:
            raise UsageError(
                f"{', '.join(asked)}: for live sources, and these are files", next_step="leave it out, name an "
                "interface with -i NAME, or go on with a file that is still written by --follow",
            )  # fmt: skip
        return paths
    if files:
        raise UsageError(
            f"files and live sources cannot be read together: {files[0]} and {words[0]}",
            next_step="read one after the other",
        )
    return _opened(words, live, plant, ports)


def _followed(paths: Sequence[str], live: LiveOptions, plant: Project) -> Source:
    """Return a file that is still written, as a live source; what has to be waited for is told."""
    import os

    from nvscope.capture.live.open import is_live

    if len(paths) != 1 or live.interfaces or is_live(paths[0]):
        raise UsageError(
            "--follow takes one file, or - for stdin, and nothing beside it",
            next_step="interfaces are watched without it; several files at a time can be read when they are complete",
        )
    if live.of_interfaces:
        raise UsageError(
            f"{', '.join(live.of_interfaces)}: for interfaces, and this is a file", next_step="leave it out"
        )
    path = paths[0]
    if path != "-":
        from nvscope.view.escape import visible

        if not os.path.lexists(path):
            echo(f"nvscope: {visible(path)}: not there yet; it is waited for.", err=True)
        elif os.path.isfile(path) and not os.path.getsize(path):
            echo(f"nvscope: {visible(path)}: still empty; its first packet is waited for.", err=True)
    return _streamed(path, live, plant)


def _streamed(path: str, live: LiveOptions, plant: Project) -> Source:
    from nvscope.capture.live.open import LiveSettings, open_stream

    return open_stream(path, LiveSettings(autostop=_autostop(live), renamed=plant.channels))


def _named(interface: str) -> str:
    """Return the source that -i means, which may be a number of -D."""
    from nvscope.capture.live.device import names
    from nvscope.capture.live.listing import word_of

    is_number = interface.isdecimal() and interface.isascii() and len(interface) < 6
    return word_of(int(interface)) if is_number and interface not in names() else interface


def _opened(words: Sequence[str], live: LiveOptions, plant: Project, ports: PortRules | None) -> Source:
    from dissectors.netvar import PORT
    from nvscope.capture.live.open import LiveSettings, open_live
    from nvscope.cli.privileges import drop_privileges

    if live.of_interfaces and all(word.startswith(("can:", "udp:")) for word in words):
        raise UsageError(
            f"{', '.join(live.of_interfaces)}: for interfaces, and {words[0][:80]} is none", next_step="leave it out"
        )
    wanted = {PORT, *plant.ports, *(ports.telegrams if ports else ())}
    wanted |= {key.port for key in plant.definition.by_key() if isinstance(key.port, int)}
    size = None if live.buffer_mib is None else max(int(live.buffer_mib * _MEGABYTE), 1)
    source = open_live(
        words,
        LiveSettings(
            autostop=_autostop(live), bpf=live.bpf, ports=wanted, tcp=_tcp_ports(plant),
            promiscuous=not live.not_promiscuous, buffer_bytes=size, renamed=plant.channels,
        ),
    )  # fmt: skip
    drop_privileges()
    _tell_what_is_heard(words)
    return source


def _tcp_ports(plant: Project) -> Sequence[int]:
    """Return the TCP ports over which some protocol is spoken."""
    from dissectors.claims import Claims
    from nvscope.protocols.table import PROTOCOLS, dissectors_of, of_project

    protocols = of_project(PROTOCOLS, plant)
    return Claims.of(dissector.claims for dissector in dissectors_of(protocols)).tcp


def _tell_what_is_heard(words: Sequence[str]) -> None:
    """Say of each source what it cannot see, and what it may do to others."""
    for word in words:
        if word.startswith("can:"):
            from nvscope.capture.live.can.drivers import remark_on
            from nvscope.view.escape import visible

            if remark := remark_on(word):
                echo(f"nvscope: {visible(word)}: {remark}.", err=True)
        if word.startswith("udp:"):
            echo(
                f"nvscope: {word}: a plain socket gets broadcasts, the groups it joined, and what is sent to this "
                "machine; what nodes answer to each other is not to be seen, and not judged.",
                err=True,
            )


def _autostop(live: LiveOptions) -> Any:
    from nvscope.capture.live.live_source import Autostop

    told = {} if live.duration is None else {"duration": duration_ns("--for", live.duration)}
    told |= limits("-a", live.autostop, ("duration", "packets", "filesize"))
    return Autostop(told.get("duration"), told.get("packets"), told.get("filesize"))


def _look_for(path: str) -> None:
    """Raise UnreadableInput for a bare word that is neither a file nor an interface."""
    import os

    if not _INTERFACE.fullmatch(path) or path == "-" or os.path.lexists(path):
        return  # opening it says what is wrong
    from nvscope.capture.live.device import names
    from nvscope.near_files import near_files

    devices = names()
    interfaces = f"the interfaces are {', '.join(devices[:_MOST_NAMES])}" if devices else "there are no interfaces"
    near = near_files(path)
    files = f"; files with such a name are {', '.join(near)}" if near else ""
    raise UnreadableInput("no file and no interface has this name", where=path, next_step=interfaces + files)


class Running(Protocol):
    """What is being listened to, and can be ended: a source, or another thing that listens."""

    @property
    def infos(self) -> Sequence[SourceInfo]: ...

    def stop(self) -> None: ...


class LiveRun:
    """While a live source is read: Ctrl-C, SIGTERM and SIGHUP end it in order, and a terminal sees that it goes on.

    A second Ctrl-C ends the program.
    """

    def __init__(self, source: Running, *, quiet: bool = False) -> None:
        self._source = source
        self._shows = not quiet and sys.stderr.isatty()
        self._begun_s = self._shown_s = time.monotonic()
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            # Who started the program with nohup wants it to go on.
            if number is None or (name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN):
                continue
            try:
                self._before[number] = signal.signal(number, self._end)
            except ValueError:  # not in the main thread
                return self
        return self

    def _end(self, number: int, frame: FrameType | None) -> None:
        signal.signal(number, self._before[number])
        self._source.stop()

    def __call__(self) -> None:
        now_s = time.monotonic()
        if not self._shows or now_s - self._shown_s < _STATUS_S:
            return
        self._shown_s = now_s
        infos = self._source.infos
        frames, drops = sum(info.frames for info in infos), sum(info.drops or 0 for info in infos)
        names = ", ".join(info.path for info in infos)
        lost = f", {drops} dropped" if drops else ""
        text = f"{names}: {now_s - self._begun_s:.0f} s, {frames} frames{lost}; Ctrl-C ends"
        echo(f"\r\x1b[K{text}", err=True, nl=False)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown_s > self._begun_s:
            echo("\r\x1b[K", err=True, nl=False)
        for number, before in self._before.items():
            signal.signal(number, before)
