"""What ``visu read``, ``write`` and ``list`` share: whom they ask, by which names, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer
from msgspec import Struct
from msgspec.structs import replace

from nvscope.cli.completion import nodes
from nvscope.cli.definitions import project_of
from nvscope.cli.secrets import warn_of_secrets
from nvscope.cli.sources import duration_ns
from nvscope.cli.terminal import echo, tell, width
from nvscope.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from nvscope.definition.visu_encoding import Encoding
    from nvscope.plc.visu.client import VisuClient
    from nvscope.plc.visu.document import Verdict
    from nvscope.plc.visu.variables import Variable

_MOST_VARIABLES = 10_000
_CODES = {
    "refused": ExitCode.ASSERTION_FAILED, "differs": ExitCode.ASSERTION_FAILED, "no_page": ExitCode.ASSERTION_FAILED,
    "no_list": ExitCode.ASSERTION_FAILED, "no_visu": ExitCode.ASSERTION_FAILED, "unreadable": ExitCode.DATA_LOSS,
    "unverified": ExitCode.DATA_LOSS, "misfit": ExitCode.DATA_LOSS, "miscounted": ExitCode.DATA_LOSS,
    "ambiguous": ExitCode.DATA_LOSS, "silent": ExitCode.DATA_LOSS, "broken": ExitCode.DATA_LOSS,
    "no_http": ExitCode.DATA_LOSS, "oversized": ExitCode.DATA_LOSS, "undelivered": ExitCode.CAPTURE,
    "cancelled": ExitCode.ASSERTION_FAILED,
}  # fmt: skip

UrlArgument = Annotated[
    str,
    typer.Argument(
        metavar="URL",
        help="The page, such as http://192.168.1.3/plc/webvisu.htm; or the address of the controller, or its name in "
        "the project file: then the page is looked for.",
        autocompletion=nodes,
    ),
]
VariablesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--variables",
        metavar="FILE",
        help="Take names from this file, plc_visu.xml or *.SYM_XML, and not from the controller; also several.",
        show_default=False,
    ),
]
PageOption = Annotated[
    list[str] | None,
    typer.Option(
        "--page",
        metavar="NAME.xml",
        help="A visualization whose list is fetched, in place of plc_visu.xml and visu_ini.xml; also several.",
        show_default=False,
    ),
]
TimeoutOption = Annotated[
    str, typer.Option("--timeout", metavar="DURATION", help="How long a request may take, with its answer.")
]
EncodingOption = Annotated[
    str | None,
    typer.Option(
        "--encoding",
        metavar="NAME",
        help="How texts are encoded: UTF-8, windows-1251. Without it, as the project file or else the page says "
        "(ENCODINGSTRING), which is asked for a text with more than ASCII in it; else ISO-8859-1.",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print what came of it as JSON (nvscope.visu/1).")]


class Wanted(Struct, frozen=True):
    """Whom the options say to ask, and by which names."""

    url: str
    project: str | None
    variables: Sequence[str]
    pages: Sequence[str]
    timeout: str
    allow_network: bool
    secrets: bool
    encoding: str | None = None


def client_of(wanted: Wanted) -> VisuClient:
    """Return what asks the controller; UsageError where it may not be asked. Nothing is sent yet."""
    from nvscope.plc.visu.exchange import MOST_TIMEOUT_NS
    from nvscope.plc.visu.url import visu_url

    url, timeout_ns = visu_url(wanted.url), duration_ns("--timeout", wanted.timeout)
    if timeout_ns > MOST_TIMEOUT_NS:
        raise UsageError(f"--timeout {wanted.timeout}: no more than ten minutes", next_step="leave it at 5s")
    for page in wanted.pages:
        if not page.isprintable() or "/" in page or not page.lower().endswith(".xml"):
            raise UsageError(f"--page {page[:60]}: expected the name of a file", next_step="for example PLC_VISU.xml")
    project = project_of(wanted.project, None)
    names, encoding = project.node_names, _encoding(wanted.encoding)
    named = next((address for address, name in names.items() if name.casefold() == url.host.casefold()), None)
    url = replace(url, host=named) if named else url

    from nvscope.plc.visu.client import VisuClient
    from nvscope.plc.visu.link import VisuLink

    link = VisuLink(url, allow_network=wanted.allow_network, timeout_ns=timeout_ns)
    warn_of_secrets(shown=wanted.secrets)
    if encoding is None and project.webvisu:
        encoding = project.webvisu.encoding_of(link.address)
    return VisuClient(link, secrets=wanted.secrets, server_name=names.get(link.address, ""), encoding=encoding)


def _encoding(name: str | None) -> Encoding | None:
    """Return what --encoding says; UsageError where that cannot be used."""
    if name is None:
        return None
    from nvscope.definition.visu_encoding import encoding_of

    try:
        return encoding_of(name)
    except ValueError as error:
        raise UsageError(f"--encoding: {error}", next_step="for example UTF-8, or windows-1251") from None


def known_variables(
    client: VisuClient, wanted: Wanted, words: Sequence[str]
) -> tuple[Sequence[Variable], Verdict | None]:
    """Return the variables that words name, and why they cannot be known, None where they are."""
    from nvscope.plc.visu.client import LISTS
    from nvscope.plc.visu.variables import known_of_files, needs_names, place_of

    if len(words) > _MOST_VARIABLES:
        raise UsageError(f"{len(words)} variables", next_step=f"name no more than {_MOST_VARIABLES}")
    needs = needs_names(words)
    if wanted.variables:
        client.known = known_of_files(wanted.variables)
        list(map(client.known.find, words))
    failed = client.find_page()
    if failed is None and needs and not wanted.variables:
        failed = client.fetch_lists(wanted.pages or LISTS)
        # Where things lie is said: names would only have told what is a password, and which text is none.
        if failed == "no_list" and all(place_of(word) for word in words):
            failed = None
    return ([client.known.find(word) for word in words] if failed is None else []), failed


def finish(document: dict[str, Any], *, as_json: bool, colour: bool) -> None:
    """Print what came of it, and say what is wrong with it; exits with the code for that."""
    from nvscope.report import visu as face

    if as_json or face.render(document):
        tell(document, partial(face.render, colour=colour, width=width()), as_json=as_json, colour=colour)
    code = remark(document)
    if code:
        raise typer.Exit(code)


def remark(document: dict[str, Any]) -> ExitCode:
    """Say what a person should know of a document, and what is wrong; return the exit code for that."""
    for line in remarks_of(document):
        echo(line, err=True)
    return code_of(document)


def code_of(document: dict[str, Any]) -> ExitCode:
    """Return the exit code for what came of it."""
    return _CODES.get(document["outcome"], ExitCode.GOOD)


def remarks_of(document: dict[str, Any]) -> Sequence[str]:
    """Return what is to be said of a document beside what was asked for."""
    from nvscope.report import visu as face
    from nvscope.view.escape import visible

    said = [f"nvscope: {visible(one)}." for one in face.remarks(document)]
    if failed := face.failure(document):
        where, what, next_step = map(visible, failed)
        said.append(f"nvscope: {where}: {what}\n  {next_step}")
    elif document["outcome"] == "cancelled":
        said.append("nvscope: nothing was written.")
    return said
