"""Network variables on UDP (3S-0 telegrams).

Telegrams are recognised by their identity on any port (``dissectors.netvar``), lists and senders are counted by the
state itself (``nvscope.tracker.lists``, ``nvscope.tracker.senders``), and judged by ``nvscope.findings.judge``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nvscope.protocols.protocol import Protocol

if TYPE_CHECKING:
    from nvscope.findings.kind import FindingKind
    from nvscope.view.fields.field import TelegramField
    from nvscope.view.lines.shown import MakeLines, MakeTree


def _fields() -> Sequence[TelegramField]:
    from nvscope.view.fields.netvar import NETVAR_FIELDS  # noqa: PLC0415
    from nvscope.view.fields.parameter import PARAMETER_FIELDS  # noqa: PLC0415

    return (*NETVAR_FIELDS, *PARAMETER_FIELDS)


def _lines() -> MakeLines:
    from nvscope.view.lines.netvar_line import LineWriter  # noqa: PLC0415

    return LineWriter


def _tree() -> MakeTree:
    from nvscope.view.lines.netvar_tree import TelegramTree  # noqa: PLC0415

    return TelegramTree


def _findings() -> Sequence[FindingKind]:
    from nvscope.findings import answers, consistency, header, loss, parameter, timing  # noqa: PLC0415
    from nvscope.findings.catalogue import rows_of  # noqa: PLC0415

    return [kind for theme in (header, loss, answers, consistency, timing, parameter) for kind in rows_of(theme)]


NETVAR = Protocol(
    name="nv", title="Network variables (3S-0)", fields=_fields, lines=_lines, tree=_tree, findings=_findings
)
