"""``nvscope visu serve``: a controller on this machine that answers requests of WebVisu pages."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.decode_as import DecodeOption
from nvscope.cli.definitions import GvlOption, ProjectOption
from nvscope.cli.live import LiveOptions, LiveRun, with_live_options
from nvscope.cli.sdo_serve import ServedNetworkOption
from nvscope.cli.sources import ChannelMapOption, duration_ns
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, erase_interrupt

_BOUND = "for example --bind 192.168.1.20"


@with_live_options
def serve(
    live: LiveOptions,
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TABLE.toml|SOURCE...",
            help="A table of variables; or where lists come from: an interface, udp://ADDRESS:PORT, "
            "can:INTERFACE:CHANNEL, or captures, which are played; and definition files, as for --gvl.",
            show_default=False,
        ),
    ] = None,
    bind: Annotated[str, typer.Option("--bind", metavar="ADDRESS", help="The address of this machine.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", min=0, max=0xFFFF, help="TCP port; 0: the system chooses one.")
    ] = 0,
    count: Annotated[
        int | None, typer.Option("--count", metavar="N", min=1, help="End after so many requests.", show_default=False)
    ] = None,
    allow_network: ServedNetworkOption = False,
    gvl: GvlOption = None,
    project: ProjectOption = None,
    decode: DecodeOption = None,
    channel_map: ChannelMapOption = None,
    keys: Annotated[bool, typer.Option("--keys", help="List all keys of a table and their meaning.")] = False,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Answer requests of WebVisu pages as a controller of CoDeSys V2.3 does, with a table or live lists behind it.

    Prints a line for each request; passwords are hidden. Writes of a table's variables change values while it runs,
    never the file; what is to go wrong stands in the table: refusals, delays, silence, statuses, wrong counts, odd
    HTTP. Variables of lists, which the definitions name, have the values that came last, ??? before the first, and
    cannot be written. Only this machine can ask, unless --bind names an address in a private network; all addresses and
    others need --allow-network. Ctrl-C ends it, and --for, whatever is served.
    """
    from nvscope.cli.visu_served import Asked, served_of

    if keys:
        from nvscope.plc.visu.table import document

        echo(document())
        return
    lasts_ns = None if live.duration is None else duration_ns("--for", live.duration)
    served = served_of(Asked(sources or (), live, gvl or (), project, decode or (), channel_map or ()))

    import time

    from nvscope.cli.sending import Stop
    from nvscope.plc.permission import address_of
    from nvscope.plc.visu.controller import Handled
    from nvscope.plc.visu.log import counts, request_row
    from nvscope.plc.visu.server import VisuServer
    from nvscope.plc.visu.url import VisuUrl
    from nvscope.report import visu_log
    from nvscope.view.escape import visible

    controller, stop, shown = served.controller, Stop(), colour_wanted(colour)

    def told(handled: Handled, address: str, source_port: int) -> None:
        row = request_row(handled, served.table.passwords, address, source_port, time.time_ns(), served.table.encoding)
        echo(visu_log.render(row, colour=shown, utc=utc), nl=False, color=shown)

    own, code = address_of(bind, _BOUND), 0
    with VisuServer(controller, own, port, allow_network=allow_network) as server, LiveRun(stop, quiet=True):
        # Behind the port: whoever opens an interface gives up what a low port needs.
        listening = served.listen()
        url = VisuUrl(own, server.port, served.table.path).text()
        echo(f"nvscope: {visible(served.name)}: {served.what} at {url}; Ctrl-C ends.", err=True)
        try:
            server.run(
                told, lambda: stop.asked or (listening is not None and listening.is_over), count=count,
                lasts_ns=lasts_ns,
            )  # fmt: skip
        finally:
            if listening is not None:
                code = listening.stop()
    if stop.asked:
        erase_interrupt()
    echo(f"nvscope: {visu_log.summary(counts(controller), server.ignored)}.", err=True)
    if code:
        raise typer.Exit(code)
