"""``nvscope sdo``: parameters of a controller, read and written by its Parameter Manager."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nvscope.cli.agreement import Agreed, refuse_without_terminal
from nvscope.cli.completion import nodes, parameter_types, parameters
from nvscope.cli.definitions import ProjectOption, project_of
from nvscope.cli.help import Command, Group
from nvscope.cli.sdo_serve import NetworkOption, serve
from nvscope.cli.sources import duration_ns
from nvscope.cli.terminal import ColourOption, colour_wanted, echo, tell, width
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.definition.parameter_type import ElementaryType
    from nvscope.definition.project import Project
    from nvscope.definition.variables import Type
    from nvscope.plc.parameter.conversation import Patience
    from nvscope.plc.parameter.document import Parameter
    from nvscope.plc.parameter.link import ParameterLink

_PORT = 1202
_MOST_ITEMS = 4_096
_MOST_RETRIES = 100
_ADDRESS = "for example 192.168.1.20, or the name that it has in [nodes] of the project file"
_OPTION = re.compile(r"--?[A-Za-z]")
_CODES = {
    "refused": ExitCode.ASSERTION_FAILED, "differs": ExitCode.ASSERTION_FAILED, "misfit": ExitCode.DATA_LOSS,
    "silent": ExitCode.DATA_LOSS, "busy": ExitCode.DATA_LOSS, "unverified": ExitCode.DATA_LOSS,
    "undelivered": ExitCode.CAPTURE, "cancelled": ExitCode.ASSERTION_FAILED,
}  # fmt: skip

app = typer.Typer(
    help="Read and write parameters of a controller by its Parameter Manager, or answer as one.",
    no_args_is_help=True,
    rich_markup_mode=None,
    cls=Group,
)

AddressArgument = Annotated[
    str,
    typer.Argument(
        metavar="ADDRESS", help="The controller: its address, or its name in the project file.", autocompletion=nodes
    ),
]
TypeOption = Annotated[
    str | None,
    typer.Option(
        "--type",
        metavar="TYPE",
        help="UINT, REAL, TIME, STRING(20) …; of an array, that of its elements. Without it, that of the project file.",
        show_default=False,
        autocompletion=parameter_types,
    ),
]
ItemsOption = Annotated[
    int | None,
    typer.Option(
        "--items",
        metavar="N",
        min=1,
        max=_MOST_ITEMS,
        help="Elements, as the telegram counts them. Without it, those of the array that the project file says; else "
        "1, and as many as there are values to write.",
        show_default=False,
    ),
]
PortOption = Annotated[int, typer.Option("--port", metavar="PORT", min=1, max=0xFFFF, help="UDP port of the partner.")]
TimeoutOption = Annotated[
    str, typer.Option("--timeout", metavar="DURATION", help="How long an answer is waited for; busy is asked again.")
]
RetriesOption = Annotated[
    int,
    typer.Option(
        "--retries", metavar="N", min=0, max=_MOST_RETRIES, help="How many times it is asked again without an answer."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print what came of it as JSON (nvscope.sdo/1).")]


@app.callback()
def _verbs() -> None:
    """Read and write parameters of a controller by its Parameter Manager, or answer as one."""


@app.command(cls=Command)
def read(
    address: AddressArgument,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="INDEX SUBINDEX | NAME",
            help="The parameter: two numbers, decimal or with 0x, or its name in the project file.",
            autocompletion=parameters,
        ),
    ],
    type_name: TypeOption = None,
    items: ItemsOption = None,
    project: ProjectOption = None,
    port: PortOption = _PORT,
    timeout: TimeoutOption = "500ms",
    retries: RetriesOption = 0,
    allow_network: NetworkOption = False,
    as_json: JsonOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Read a parameter of a controller, and print its value.

    ADDRESS is this machine or in a private network; elsewhere only with --allow-network. Exits with 1 where the
    controller refuses, with 3 where it does not answer, is busy, or the value is not of the type, with 5 where the
    request cannot be delivered.
    """
    patience = _patience(timeout, retries)
    parameter, rest = _parameter(address, words, project, type_name, port)
    if rest:
        raise UsageError(
            f"{rest[0][:60]} is too much", next_step="values are written with the verb write; read takes none"
        )

    from nvscope.plc.parameter import access
    from nvscope.plc.parameter.link import ParameterLink
    from nvscope.plc.parameter.value import usual_items

    with ParameterLink(parameter.address, port, allow_network=allow_network) as link:
        document = access.read(link, parameter, items or usual_items(parameter.type), patience)
    _finish(document, link, as_json=as_json, colour=colour_wanted(colour))


@app.command(cls=Command, context_settings={"ignore_unknown_options": True})
def write(
    address: AddressArgument,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="INDEX SUBINDEX VALUE | NAME VALUE",
            help="The parameter as for read, and its value: 12, 0xFF, 12.5, TRUE, T#1s500ms, a text, the name of a "
            "value of an enumeration; of an array or a structure, those of all its elements.",
            autocompletion=parameters,
        ),
    ],
    type_name: TypeOption = None,
    items: ItemsOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Write without asking.")] = False,
    project: ProjectOption = None,
    port: PortOption = _PORT,
    timeout: TimeoutOption = "500ms",
    retries: RetriesOption = 0,
    allow_network: NetworkOption = False,
    as_json: JsonOption = False,
    colour: ColourOption = "auto",
) -> None:
    """Write a parameter of a controller: read it, ask, write it, and read it back.

    Without a terminal nobody can be asked, and nothing is written without --yes. What has another size than what is to
    be written is left alone. Exits as read does, with 1 also where something else is read back than was written, with 3
    where nothing could be, but for what can only be written, with 1 where the answer was no.
    """
    patience = _patience(timeout, retries)
    if wrong := next((word for word in words if _OPTION.match(word)), None):
        raise UsageError(
            f"{wrong[:60]} is no option",
            next_step="`nvscope help sdo write` lists them; a text that begins with a dash stands in single quotes "
            "within those of the shell",
        )
    parameter, values = _parameter(address, words, project, type_name, port)
    items, data = _encoded(parameter, items, values)
    if not yes:
        refuse_without_terminal()

    from nvscope.plc.parameter import access
    from nvscope.plc.parameter.link import ParameterLink
    from nvscope.report.sdo import question

    with ParameterLink(parameter.address, port, allow_network=allow_network) as link:
        agreed = Agreed(question, asks=not yes)
        try:
            document = access.write(link, parameter, items, data, patience, agreed)
        except KeyboardInterrupt:
            if agreed.said_yes:
                echo("nvscope: broken off: it may have been written.", err=True)
            raise
    _finish(document, link, as_json=as_json, colour=colour_wanted(colour))


app.command(cls=Command)(serve)


def _finish(document: dict[str, Any], link: ParameterLink, *, as_json: bool, colour: bool) -> None:
    """Print what came of it, and say what is wrong with it; exits with the code for that."""
    from nvscope.report import sdo as face

    if as_json or face.render(document):
        tell(document, partial(face.render, colour=colour, width=width()), as_json=as_json, colour=colour)
    from nvscope.view.escape import visible

    for remark in face.remarks(document):
        echo(f"nvscope: {visible(remark)}.", err=True)
    if failed := face.failure(document):
        where, what, next_step = map(visible, failed)
        echo(f"nvscope: {where}: {what}\n  {next_step}", err=True)
        if document["outcome"] == "silent" and link.is_port_taken:
            port = document["port"]
            echo(f"  another program has port {port} here: an answer to that port does not come", err=True)
    elif document["outcome"] == "cancelled":
        echo("nvscope: nothing was written.", err=True)
    if code := _CODES.get(document["outcome"]):
        raise typer.Exit(code)


def _parameter(
    address: str, words: Sequence[str], project: str | None, type_name: str | None, port: int
) -> tuple[Parameter, Sequence[str]]:
    """Return what is asked for, and the words behind it; UsageError where that cannot be understood."""
    from nvscope.definition.parameter_place import parameter_place, place_number
    from nvscope.plc.parameter.document import Parameter
    from nvscope.plc.permission import address_of

    plant = project_of(project, None)
    called = [(known, name) for known, name in plant.node_names.items() if name.lower() == address.lower()]
    called = [one for one in called if one[1] == address] or called
    named = called[0][0] if len(called) == 1 else None
    partner = named or address_of(address, _ADDRESS)
    if place_number(words[0]) is not None and len(words) > 1 and place_number(words[1]) is not None:
        place, rest = (place_number(words[0]) or 0, place_number(words[1]) or 0), words[2:]
    elif (found := parameter_place(words[0])) is not None and not found[0]:
        place, rest = found[1:], words[1:]
    elif _is_number(words[0]):
        raise _not_understood(words)
    else:
        place, rest = _place_of(plant, partner, words[0]), words[1:]
    known = plant.definition.parameters and plant.definition.parameters.of(partner, *place)
    kind: Type | None = _type(type_name) if type_name is not None else known.type if known else None
    node_name = plant.node_names.get(partner, "")
    return Parameter(partner, port, *place, node_name, known.name if known else "", kind), rest


def _is_number(word: str) -> bool:
    return word[:1].isdecimal() or word.startswith("-")


def _not_understood(words: Sequence[str]) -> UsageError:
    return UsageError(
        f"{' '.join(words[:2])[:80]}: expected INDEX and SUBINDEX from 0 to 65535, or a name",
        next_step="for example 0x2000 1",
    )


def _place_of(plant: Project, partner: str, name: str) -> tuple[int, int]:
    """Return Index and SubIndex of a parameter of a node by its name, in any case where none is called just so."""
    known = plant.definition.parameters.known if plant.definition.parameters else ()
    mine = [one for one in known if one.name.lower() == name.lower() and one.node in (partner, "")]
    mine = [one for one in mine if one.name == name] or mine
    mine = [one for one in mine if one.node] or mine
    if len(mine) == 1:
        return mine[0].index, mine[0].subindex
    if mine:
        places = ", ".join(f"0x{one.index:04x} {one.subindex}" for one in mine[:5])
        raise UsageError(f"several parameters are called '{name[:60]}'", next_step=f"name one of them: {places}")
    names = [one.name for one in known if one.name and one.node in (partner, "")]
    from nvscope.toml_table import nearest

    raise UsageError(
        f"no parameter of {partner} is called '{name[:60]}'",
        next_step=nearest(name, names) or "write Index and SubIndex, such as 0x2000 1; [parameters] of the project "
        "file gives names",
    )  # fmt: skip


def _type(name: str) -> ElementaryType:
    from nvscope.definition.parameter_type import known_parameter_types, parameter_type

    found = parameter_type(name)
    if found is None:
        raise UsageError(
            f"--type {name[:60]}: no type that a parameter can have here",
            next_step=f"known are {known_parameter_types()}; arrays and declared types stand in [parameters] of the "
            "project file",
        )
    return found


def _encoded(parameter: Parameter, items: int | None, values: Sequence[str]) -> tuple[int, bytes]:
    """Return what Items says, and the bytes of a value by its elements; UsageError where they are none of the type."""
    if not values:
        raise UsageError("a value is missing", next_step="write it behind the parameter")
    kind = parameter.type
    if kind is None:
        raise UsageError(
            "the type of the parameter is not known, and without it nobody knows its bytes",
            next_step="name it with --type, or in [parameters] of the project file",
        )
    from nvscope.definition.variables import Array, Structure, type_text
    from nvscope.plc.parameter.message import MOST_DATA_BYTES
    from nvscope.plc.parameter.value import entered, usual_items

    counted = items or (usual_items(kind) if isinstance(kind, Structure | Array) else len(values))
    try:
        data = entered(kind, counted, values)
    except ValueError as error:
        raise UsageError(str(error), next_step=f"the type is {type_text(kind)[:200]}") from None
    if len(data) > MOST_DATA_BYTES:
        raise UsageError(f"the value has {len(data)} bytes", next_step=f"no more than {MOST_DATA_BYTES} are sent")
    return counted, data


def _patience(timeout: str, retries: int) -> Patience:
    from nvscope.plc.parameter.conversation import MOST_TIMEOUT_NS, Patience

    timeout_ns = duration_ns("--timeout", timeout)
    if timeout_ns > MOST_TIMEOUT_NS:
        raise UsageError(f"--timeout {timeout}: no more than ten minutes", next_step="--retries asks again")
    return Patience(timeout_ns, retries)
