"""``nvscope doctor``: why do I see nothing?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from nvscope.cli.completion import interfaces
from nvscope.cli.definitions import GvlOption, ProjectOption, project_of, tell_of_flaws
from nvscope.cli.live import LiveRun
from nvscope.cli.named_files import named_files
from nvscope.cli.sources import ReadOption, duration_ns, tell_of_losses
from nvscope.cli.terminal import ColourOption, colour_wanted, tell, width
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from dissectors.batch import PacketBatch
    from nvscope.capture.live.udp_socket import UdpAddress
    from nvscope.definition.project import Project
    from nvscope.doctor.case import Case

_ALL = "all"


def doctor(
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SOURCE...]",
            help="Interfaces to listen on, without one all; udp://ADDRESS:PORT with multicast groups behind commas; or "
            "capture files; and definition files, as for --gvl.",
            show_default=False,
        ),
    ] = None,
    read: ReadOption = None,
    interface: Annotated[
        list[str] | None,
        typer.Option(
            "-i", "--interface", metavar="NAME", help="Listen on an interface; also several.", show_default=False,
            autocompletion=interfaces,
        ),
    ] = None,
    duration: Annotated[str, typer.Option("--for", metavar="DURATION", help="Listen so long, or until Ctrl-C.")] = "4s",
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON (nvscope.doctor/1).")] = False,
    everything: Annotated[bool, typer.Option("-v", "--all", help="Show what is well, too.")] = False,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="No progress bar.")] = False,
    colour: ColourOption = "auto",
) -> None:  # fmt: skip
    """Tell why nothing is seen: interfaces, netmasks, ports, permissions, firewall, clock, and what comes instead.

    It listens for a few seconds, and sends nothing. What should come is what the project and the definitions say, else
    anything on UDP 1202. Of capture files it tells what can be seen there. Exits with 0 where nothing is wrong, 1 where
    something is, 3 where a file could not be read to its end, 5 where no interface has the name.
    """
    from nvscope.capture.live.open import is_live

    wanted_ns = duration_ns("--for", duration)
    named = named_files(sources, read, gvl, interface or [_ALL])
    live = [*(interface or ()), *(word for word in named.captures if is_live(word))]
    files = [word for word in named.captures if not is_live(word)]
    if files and live:
        raise UsageError(
            f"files and live sources cannot be looked at together: {files[0]} and {live[0]}",
            next_step="ask for one after the other",
        )
    plant = project_of(project, named.definitions)

    from nvscope.doctor.diagnosis import diagnose, document
    from nvscope.report import doctor as face

    code = ExitCode.GOOD
    if files:
        case, code = _read(files, plant, quiet=quiet)
    else:
        case = _heard(live, plant, wanted_ns, quiet=quiet)
    found = diagnose(case)
    shown = colour_wanted(colour)
    tell(
        document(found), lambda told: face.render(told, everything=everything, colour=shown, width=width()),
        as_json=as_json, colour=shown,
    )  # fmt: skip
    tell_of_flaws(plant.definition)
    if code or found.problems:
        raise typer.Exit(code or ExitCode.ASSERTION_FAILED)


def _heard(live: Sequence[str], plant: Project, wanted_ns: int, *, quiet: bool) -> Case:
    """Look at this machine, and listen."""
    from nvscope.cli.privileges import drop_privileges
    from nvscope.doctor.case import Case
    from nvscope.doctor.expected import expected_of
    from nvscope.doctor.facts.listening import Listening
    from nvscope.doctor.facts.machine import interfaces_now, look

    sockets, names = _parted(live)
    expected = expected_of(plant, sockets)
    machine = look(expected.ports)
    listening = Listening.open(expected, machine, names)
    drop_privileges()
    with LiveRun(listening, quiet=quiet) as progress:
        traffic = listening.hear(wanted_ns, progress)
    lasted_ns = listening.lasted_ns if listening.infos else None
    # A carrier may have come meanwhile: the kernel tells of it up to a second late.
    machine = replace(machine, interfaces=interfaces_now())
    return Case(expected, traffic, tuple(listening.places), machine, lasted_ns, names, asks_sockets=bool(sockets))


def _parted(live: Sequence[str]) -> tuple[Sequence[UdpAddress], Sequence[str]]:
    """Return the plain sockets and the interfaces of what was named."""
    from nvscope.capture.live.device import device_of
    from nvscope.capture.live.udp_socket import PREFIX, UdpAddress

    if on_can := [
        word for word in live if word.startswith("can:") or ((device := device_of(word)) is not None and device.is_can)
    ]:  # fmt: skip
        raise UsageError(
            "the doctor looks at networks, not at CAN buses", where=on_can[0],
            next_step="`ip -details link show` tells of the interfaces of CAN, and candump shows what comes",
        )  # fmt: skip
    sockets = [UdpAddress.of(word) for word in live if word.startswith(PREFIX)]
    return sockets, [word for word in live if not word.startswith(PREFIX)]


def _read(files: Sequence[str], plant: Project, *, quiet: bool) -> tuple[Case, ExitCode]:
    """Read capture files."""
    import numpy as np

    from nvscope.capture.open import open_source
    from nvscope.cli.progress import watching
    from nvscope.doctor.case import Case
    from nvscope.doctor.expected import expected_of
    from nvscope.doctor.facts.traffic import ListenedTo, Traffic

    expected = expected_of(plant)
    source, traffic = open_source(files), Traffic(expected.ports)
    with watching(quiet=quiet)(source) as progress:
        for batch in source:
            if batch.source is None:
                traffic.observe(batch, 0)
            else:
                for number in np.unique(batch.source).tolist():
                    traffic.observe(_of_source(batch, number), number)
            progress()
    infos = source.infos
    places = tuple(ListenedTo(info.path, True, info.frames) for info in infos)
    return Case(expected, traffic, places), tell_of_losses(infos)


def _of_source(batch: PacketBatch, number: int) -> PacketBatch:
    """Return the packets of one of several sources."""
    mine = batch.source == number
    columns = {
        name: column[mine] for name in ("offset", "captured", "original", "ts_ns", "link", "channel", "direction")
        if (column := getattr(batch, name)) is not None
    }  # fmt: skip
    return replace(batch, **columns, source=None, ends=())
