"""``nvscope visu serve``: a controller on this machine that answers requests of WebVisu pages."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.sdo_serve import NetworkOption
from nvscope.cli.sources import duration_ns
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, erase_interrupt
from nvscope.errors import UsageError

_BOUND = "for example --bind 192.168.1.20"


def serve(
    table: Annotated[str | None, typer.Argument(metavar="TABLE.toml", show_default=False)] = None,
    bind: Annotated[str, typer.Option("--bind", metavar="ADDRESS", help="The address of this machine.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", min=0, max=0xFFFF, help="TCP port; 0: the system chooses one.")
    ] = 0,
    count: Annotated[
        int | None, typer.Option("--count", metavar="N", min=1, help="End after so many requests.", show_default=False)
    ] = None,
    duration: Annotated[
        str | None, typer.Option("--for", metavar="DURATION", help="End after this time.", show_default=False)
    ] = None,
    allow_network: NetworkOption = False,
    keys: Annotated[bool, typer.Option("--keys", help="List all keys of a table and their meaning.")] = False,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Answer requests of WebVisu pages as a controller of CoDeSys V2.3 does, with the variables of a table.

    Prints a line for each request; passwords are hidden. Writes change values while it runs, never the file. What is to
    go wrong stands in the table: refusals, delays, silence, statuses, wrong counts, odd HTTP. Only this machine can
    ask, unless --bind names an address in a private network; all addresses and others need --allow-network. Ctrl-C ends
    it.
    """
    from nvscope.plc.visu.table import document, read_served

    if keys:
        echo(document())
        return
    if table is None:
        raise UsageError("a table is needed", next_step="`nvscope visu serve --keys` lists what it can say")
    lasts_ns = None if duration is None else duration_ns("--for", duration)
    served = read_served(table)

    import time

    from nvscope.cli.live import LiveRun
    from nvscope.cli.sending import Stop
    from nvscope.plc.permission import address_of
    from nvscope.plc.visu.controller import Controller, Handled
    from nvscope.plc.visu.log import counts, request_row
    from nvscope.plc.visu.server import VisuServer
    from nvscope.plc.visu.url import VisuUrl
    from nvscope.report import visu_log
    from nvscope.units import count_of
    from nvscope.view.escape import visible

    controller, stop, shown = Controller(served), Stop(), colour_wanted(colour)

    def told(handled: Handled, address: str, source_port: int) -> None:
        row = request_row(handled, address, source_port, time.time_ns())
        echo(visu_log.render(row, colour=shown, utc=utc), nl=False, color=shown)

    own = address_of(bind, _BOUND)
    with VisuServer(controller, own, port, allow_network=allow_network) as server, LiveRun(stop, quiet=True):
        variables, url = count_of(len(served.entries), "variable"), VisuUrl(own, server.port, served.path).text()
        echo(f"nvscope: {visible(table)}: {variables} at {url}; Ctrl-C ends.", err=True)
        server.run(told, lambda: stop.asked, count=count, lasts_ns=lasts_ns)
    if stop.asked:
        erase_interrupt()
    echo(f"nvscope: {visu_log.summary(counts(controller), server.ignored)}.", err=True)
