"""``nvscope visu write``: a variable of a controller, written by its WebVisu after a look and a question."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import typer

from nvscope.cli.agreement import Agreed, refuse_without_terminal
from nvscope.cli.completion import visu_variables
from nvscope.cli.definitions import ProjectOption
from nvscope.cli.sdo_serve import NetworkOption
from nvscope.cli.secrets import SecretsOption
from nvscope.cli.terminal import ColourOption, colour_wanted, echo
from nvscope.cli.visu_asked import (
    EncodingOption,
    JsonOption,
    PageOption,
    TimeoutOption,
    UrlArgument,
    VariablesOption,
    Wanted,
    client_of,
    finish,
    known_variables,
)
from nvscope.errors import UsageError

if TYPE_CHECKING:
    from dissectors.webvisu import Place
    from nvscope.definition.visu_encoding import Encoding

_OPTION = re.compile(r"--?[A-Za-z]")


def write(
    url: UrlArgument,
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="The variable: its name, in any case, or where it lies: ref,offset,size,type.",
            autocompletion=visu_variables,
        ),
    ],
    value: Annotated[
        str, typer.Argument(metavar="VALUE", help="Its value: 12, 0xFF, 12.5, TRUE, T#1s500ms or ms, a text.")
    ],
    yes: Annotated[bool, typer.Option("--yes", help="Write without asking.")] = False,
    variables: VariablesOption = None,
    page: PageOption = None,
    project: ProjectOption = None,
    encoding: EncodingOption = None,
    timeout: TimeoutOption = "5s",
    allow_network: NetworkOption = False,
    show_secrets: SecretsOption = False,
    as_json: JsonOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Write a variable of a controller: read it, ask, write it, and read it back.

    Without a terminal nobody can be asked, and nothing is written without --yes. Exits as read does, with 1 also where
    something else is read back than was written, with 3 where nothing could be, with 1 where the answer was no.
    """
    if wrong := next((word for word in (name, value) if _OPTION.match(word)), None):
        raise UsageError(
            f"{wrong[:60]} is no option",
            next_step="`nvscope help visu write` lists them; a text that begins with a dash stands in single quotes "
            "within those of the shell",
        )
    if not yes:
        refuse_without_terminal()
    wanted = Wanted(url, project, variables or (), page or (), timeout, allow_network, show_secrets, encoding)
    shown = colour_wanted(colour)
    client = client_of(wanted)

    from dissectors.webvisu import STRING
    from nvscope.plc.visu.variables import place_of
    from nvscope.report.visu import question

    if (place := place_of(name)) is not None and (place.type != STRING or value.isascii()):
        _sent(place, value)  # before anything is asked
    found, failed = known_variables(client, wanted, [name])
    if failed is not None:
        finish(client.document("write", failed), as_json=as_json, colour=shown)
        return
    (variable,) = found
    is_text = variable.place.type == STRING
    sent = _sent(variable.place, value, client.encoding_for([value]) if is_text else None)
    agreed = Agreed(question, asks=not yes)
    try:
        document = client.write(variable, sent, agreed)
    except KeyboardInterrupt:
        if agreed.said_yes:
            echo("nvscope: broken off: it may have been written.", err=True)
        raise
    finish(document, as_json=as_json, colour=shown)


def _sent(place: Place, value: str, encoding: Encoding | None = None) -> str:
    """Return a value as it goes onto the wire; UsageError where it is none of the type."""
    from nvscope.definition.visu_encoding import LATIN
    from nvscope.definition.visu_values import type_at, type_name
    from nvscope.plc.visu.value import entered

    try:
        return entered(place, value, encoding or LATIN)
    except ValueError as error:
        known = type_at(place)
        kind = known.name if known else type_name(place.type) or f"type {place.type}"
        raise UsageError(str(error), next_step=f"the type is {kind}") from None
