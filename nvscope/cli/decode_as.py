"""What -d says: of which ports it is decided by hand what is on them, as tshark's option of that name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from nvscope.errors import UsageError

if TYPE_CHECKING:
    from dissectors.netvar import PortRules
    from nvscope.definition.project import Project

_DECODE_AS = re.compile(r"\s*(udp|tcp)\.port\s*==\s*(\d+)(?:-(\d+))?\s*,\s*(\w+)\s*", re.ASCII)
_MAX_PORT = 65535
_TELEGRAMS, _NO_TELEGRAMS, _PAGES = ("udp", "nvl"), ("udp", "data"), ("tcp", "http")

DecodeOption = Annotated[
    list[str] | None,
    typer.Option(
        "-d",
        metavar="(udp|tcp).port==PORT,WHAT",
        help="Decide what is on a port, or on ports FIRST-LAST. udp.port==PORT,nvl: telegrams, whatever their "
        "identity. udp.port==PORT,data: no telegrams. tcp.port==PORT,http: WebVisu is looked for there, too.",
        show_default=False,
    ),
]


def port_rules(options: Sequence[str] | None) -> PortRules | None:
    """Return what the -d options say of UDP, None without any; UsageError where one cannot be understood."""
    ports = _ports(options)
    if not ports[_TELEGRAMS] and not ports[_NO_TELEGRAMS]:
        return None
    from dissectors.netvar import PortRules

    return PortRules(tuple(ports[_TELEGRAMS]), tuple(ports[_NO_TELEGRAMS]))


def with_page_ports(project: Project, options: Sequence[str] | None) -> Project:
    """Return a project with the TCP ports of -d beside its own; UsageError where one cannot be understood."""
    further = _ports(options)[_PAGES]
    if not further:
        return project
    from nvscope.definition.webvisu import WebVisu

    known = project.webvisu or WebVisu()
    return replace(project, webvisu=replace(known, ports=tuple(dict.fromkeys((*known.ports, *further)))))


def _ports(options: Sequence[str] | None) -> dict[tuple[str, str], list[int]]:
    ports: dict[tuple[str, str], list[int]] = {_TELEGRAMS: [], _NO_TELEGRAMS: [], _PAGES: []}
    for option in options or ():
        match = _DECODE_AS.fullmatch(option)
        first, last = (int(match[2]), int(match[3] or match[2])) if match else (0, -1)
        what = (match[1], match[4]) if match else None
        if what not in ports or not (what == _PAGES) <= first <= last <= _MAX_PORT:
            raise UsageError(
                f"-d {option}: expected udp.port==PORT,nvl or udp.port==PORT,data or tcp.port==PORT,http",
                next_step="for example -d udp.port==1300,nvl, or -d tcp.port==8081,http, or a range: "
                "-d udp.port==1300-1310,data",
            )
        ports[what] += range(first, last + 1)
    return ports
