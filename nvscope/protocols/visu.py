"""WebVisu: the HTTP requests with which web visualization pages read and write variables of a controller.

Connections over its ports are followed (``nvscope.tracker.streams``), and requests recognised by what is in them
(``dissectors.webvisu``), never by their address.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain
from typing import TYPE_CHECKING

from msgspec.structs import replace

from nvscope.protocols.protocol import Protocol
from nvscope.tracker.visu.controllers import USUAL_PORTS
from nvscope.tracker.visu.on_demand import NAME, FollowOnDemand, VisuState

if TYPE_CHECKING:
    from dissectors.dissector import Dissector
    from nvscope.definition.webvisu import WebVisu
    from nvscope.findings.facts import Facts
    from nvscope.findings.finding import Finding
    from nvscope.findings.kind import FindingKind
    from nvscope.view.fields.field import TelegramField
    from nvscope.view.lines.moments import Moment
    from nvscope.view.lines.shown import LineMaker, Tree, Wording
    from nvscope.view.rows.frames import FrameRows


def page_ports(webvisu: WebVisu | None) -> tuple[int, ...]:
    """Return the TCP ports over which pages are looked for, with what a project says of it."""
    return *USUAL_PORTS, *(webvisu.ports if webvisu else ())


def _dissector(webvisu: WebVisu | None = None) -> Dissector:
    from dissectors.claims import Claims  # noqa: PLC0415
    from dissectors.dissector import Dissector  # noqa: PLC0415

    ports = page_ports(webvisu)
    given, encodings = (webvisu.lists, webvisu.encodings) if webvisu else ((), {})
    return Dissector(NAME, Claims(tcp=ports), begin=lambda: FollowOnDemand(ports, given, encodings))


def visu_of(webvisu: WebVisu) -> Protocol:
    """Return the protocol with what a project says of it: further ports, and names of variables."""
    return replace(VISU, dissector=lambda: _dissector(webvisu))


def with_secrets(protocols: Iterable[Protocol]) -> list[Protocol]:
    """Return protocols whose fields have passwords in clear."""
    return [replace(one, fields=lambda: _fields(secrets=True)) if one is VISU else one for one in protocols]


def _fields(*, secrets: bool = False) -> Sequence[TelegramField]:
    from nvscope.view.fields.visu import VISU_FIELDS, visu_fields  # noqa: PLC0415

    return visu_fields(secrets=True) if secrets else VISU_FIELDS


def _lines(moment: Moment, width: int | None, wording: Wording) -> LineMaker:
    from nvscope.view.lines.visu_line import visu_lines  # noqa: PLC0415

    return visu_lines(moment, width, wording)


def _tree(rows: FrameRows, wording: Wording, *, dumps: bool) -> Tree:
    from nvscope.view.lines.visu_tree import VisuTree  # noqa: PLC0415

    return VisuTree(rows, wording, dumps=dumps)


def _findings() -> Sequence[FindingKind]:
    from nvscope.findings import visu, visu_disorder  # noqa: PLC0415
    from nvscope.findings.catalogue import rows_of  # noqa: PLC0415

    return [*rows_of(visu), *rows_of(visu_disorder)]


def _judge(facts: Facts) -> Iterable[Finding]:
    known = facts.state.others[NAME]
    if not isinstance(known, VisuState) or known.known is None:
        return ()
    from nvscope.findings.visu import judge_visu  # noqa: PLC0415
    from nvscope.findings.visu_disorder import judge_disorder  # noqa: PLC0415

    return chain(judge_visu(facts, known.known), judge_disorder(facts, known.known))


VISU = Protocol(
    name=NAME, title="WebVisu", fields=_fields, lines=lambda: _lines, tree=lambda: _tree, findings=_findings,
    dissector=_dissector, observe=VisuState, judge=_judge,
)  # fmt: skip
