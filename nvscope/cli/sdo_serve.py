"""``nvscope sdo serve``: a controller on this machine that answers requests of the Parameter Manager."""

from __future__ import annotations

from typing import Annotated

import typer

from nvscope.cli.sources import duration_ns
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, erase_interrupt
from nvscope.errors import UsageError

_PORT = 1202
_BOUND = "for example --bind 192.168.1.20"

NetworkOption = Annotated[
    bool, typer.Option("--allow-network", help="Send also to what is neither this machine nor in a private network.")
]
ServedNetworkOption = Annotated[
    bool, typer.Option("--allow-network", help="Let --bind name any address, and 0.0.0.0 or :: for all.")
]


def serve(
    table: Annotated[str | None, typer.Argument(metavar="TABLE.toml", show_default=False)] = None,
    bind: Annotated[str, typer.Option("--bind", metavar="ADDRESS", help="The address of this machine.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", min=0, max=0xFFFF, help="UDP port; 0: the system chooses one.")
    ] = _PORT,
    count: Annotated[
        int | None, typer.Option("--count", metavar="N", min=1, help="End after so many requests.", show_default=False)
    ] = None,
    duration: Annotated[
        str | None, typer.Option("--for", metavar="DURATION", help="End after this time.", show_default=False)
    ] = None,
    allow_network: ServedNetworkOption = False,
    keys: Annotated[bool, typer.Option("--keys", help="List all keys of a table and their meaning.")] = False,
    utc: Annotated[bool, typer.Option("--utc", help="Show times in UTC.")] = False,
    colour: ColourOption = "auto",
) -> None:
    """Answer requests of the Parameter Manager as a controller does, with the parameters of a table.

    Prints a line for each request. Writes change values while it runs, never the file. What is to go wrong stands in
    the table: refusals, delays, silence, busy. Only this machine can ask, unless --bind names an address in a private
    network; all addresses and others need --allow-network. Ctrl-C ends it.
    """
    from nvscope.plc.parameter.table import document, read_served

    if keys:
        echo(document())
        return
    if table is None:
        raise UsageError("a table is needed", next_step="`nvscope sdo serve --keys` lists what it can say")
    lasts_ns = None if duration is None else duration_ns("--for", duration)
    served = read_served(table)

    import time

    from nvscope.cli.live import LiveRun
    from nvscope.cli.sending import Stop
    from nvscope.plc.parameter.controller import Controller, Handled
    from nvscope.plc.parameter.log import counts, request_row
    from nvscope.plc.parameter.server import ParameterServer
    from nvscope.plc.permission import address_of
    from nvscope.report import sdo_log
    from nvscope.units import count_of, endpoint
    from nvscope.view.escape import visible

    controller, stop, shown = Controller(served), Stop(), colour_wanted(colour)

    def told(handled: Handled, address: str, source_port: int) -> None:
        row = request_row(handled, address, source_port, time.time_ns())
        echo(sdo_log.render(row, colour=shown, utc=utc), nl=False, color=shown)

    own = address_of(bind, _BOUND)
    with ParameterServer(controller, own, port, allow_network=allow_network) as server, LiveRun(stop, quiet=True):
        parameters = count_of(len(served.entries), "parameter")
        echo(f"nvscope: {visible(table)}: {parameters} at {endpoint(own, server.port)}; Ctrl-C ends.", err=True)
        server.run(told, lambda: stop.asked, count=count, lasts_ns=lasts_ns)
    if stop.asked:
        erase_interrupt()
    echo(f"nvscope: {sdo_log.summary(counts(controller), controller.ignored)}.", err=True)
