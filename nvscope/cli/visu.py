"""``nvscope visu``: variables of a controller, listed, read and written by its WebVisu."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.cli.completion import visu_variables
from nvscope.cli.definitions import ProjectOption
from nvscope.cli.help import Command, Group
from nvscope.cli.sdo_serve import NetworkOption
from nvscope.cli.secrets import SecretsOption
from nvscope.cli.sources import duration_ns
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, erase_interrupt
from nvscope.cli.visu_asked import (
    EncodingOption,
    JsonOption,
    PageOption,
    TimeoutOption,
    UrlArgument,
    VariablesOption,
    Wanted,
    client_of,
    code_of,
    finish,
    known_variables,
    remarks_of,
)
from nvscope.cli.visu_serve import serve
from nvscope.cli.visu_write import write
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.plc.visu.client import VisuClient
    from nvscope.plc.visu.variables import Variable

_POLL_S = 0.05

app = typer.Typer(
    help="List, read and write variables of a controller by its WebVisu (CoDeSys V2.3), or answer as one.",
    no_args_is_help=True,
    rich_markup_mode=None,
    cls=Group,
)


@app.callback()
def _verbs() -> None:
    """List, read and write variables of a controller by its WebVisu (CoDeSys V2.3), or answer as one."""


@app.command(cls=Command)
def read(
    url: UrlArgument,
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME…",
            help="Variables: their names, in any case, or where they lie: ref,offset,size,type, such as 4,146,81,8.",
            autocompletion=visu_variables,
        ),
    ],
    variables: VariablesOption = None,
    page: PageOption = None,
    every: Annotated[
        str | None, typer.Option("--every", metavar="DURATION", help="Read again and again.", show_default=False)
    ] = None,
    count: Annotated[
        int | None, typer.Option("--count", metavar="N", min=1, help="So many times.", show_default=False)
    ] = None,
    project: ProjectOption = None,
    encoding: EncodingOption = None,
    timeout: TimeoutOption = "5s",
    allow_network: NetworkOption = False,
    show_secrets: SecretsOption = False,
    as_json: JsonOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Read variables of a controller, and print their values.

    The controller is this machine or in a private network; elsewhere only with --allow-network. Names come from the
    lists beside its page. Exits with 1 where it refuses, with 3 where it does not answer in time or as it should, or
    cannot read a variable, with 5 where nobody is there. With --every, a line each time, with --json a document a line.
    """
    every_ns = None if every is None else duration_ns("--every", every)
    if count is not None and every_ns is None:
        raise UsageError("--count is how many times --every reads", next_step="for example --every 1s --count 10")
    wanted = Wanted(url, project, variables or (), page or (), timeout, allow_network, show_secrets, encoding)
    client = client_of(wanted)
    found, failed = known_variables(client, wanted, names)
    shown = colour_wanted(colour)
    if failed is not None:
        finish(client.document("read", failed), as_json=as_json, colour=shown)
    elif every_ns is None:
        finish(client.read(found), as_json=as_json, colour=shown)
    else:
        _poll(client, found, every_ns, count, as_json=as_json, colour=shown)


def _poll(
    client: VisuClient, found: Sequence[Variable], every_ns: int, count: int | None, *, as_json: bool, colour: bool
) -> None:
    """Read again and again, up to Ctrl-C: ``every_ns`` behind the time before, or at once where that took longer.

    What is to be said beside values is said when it is new: once, not with each of them.
    """
    import json

    from nvscope.cli.live import LiveRun
    from nvscope.cli.sending import Stop
    from nvscope.report import visu as face

    stop, code, left, due_ns = Stop(), ExitCode.GOOD, count, time.monotonic_ns()
    said: Sequence[str] = ()
    with LiveRun(stop, quiet=True):
        while left != 0 and not stop.asked:
            if (wait_ns := due_ns - time.monotonic_ns()) > 0:
                time.sleep(min(wait_ns / 1e9, _POLL_S))
                continue
            time_ns, document = time.time_ns(), client.read(found)
            text = f"{json.dumps(document)}\n" if as_json else face.reading(document, time_ns, colour=colour)
            echo(text, nl=False, color=colour)
            before, said = said, remarks_of(document)
            for line in said if said != before else ():
                echo(line, err=True)
            code = max(code, code_of(document))
            client.forget()
            due_ns = max(due_ns + every_ns, time.monotonic_ns())
            left = None if left is None else left - 1
    if stop.asked:
        erase_interrupt()
    if code:
        raise typer.Exit(code)


@app.command("list", cls=Command)
def list_variables(
    url: UrlArgument,
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME…",
            help="List these alone: names, in any case, * for any text and ? for one character; or addresses.",
            show_default=False,
        ),
    ] = None,
    page: PageOption = None,
    project: ProjectOption = None,
    timeout: TimeoutOption = "5s",
    allow_network: NetworkOption = False,
    as_json: JsonOption = False,
    colour: ColourOption = "auto",
) -> None:
    """List the variables that a controller has for its WebVisu: names, types, and where they lie.

    They are what the visualizations show, and nothing else. Exits as read does, with 1 where there is no list.
    """
    from nvscope.plc.visu.client import LISTS

    wanted = Wanted(url, project, (), page or (), timeout, allow_network, secrets=False)
    client = client_of(wanted)
    failed = client.find_page() or client.fetch_lists(wanted.pages or LISTS)
    document = client.listed(names or ()) if failed is None else client.document("list", failed)
    finish(document, as_json=as_json, colour=colour_wanted(colour))


app.command(cls=Command, context_settings={"ignore_unknown_options": True})(write)
app.command(cls=Command)(serve)
