"""CAN: network variables as PDOs, and what CANopen and the controllers say beside them.

Frames are recognised by their link type (``dissectors.can.frame``). Buses are counted by the state itself
(``nvscope.tracker.can``), lists on CAN as those on UDP; ``nvscope.findings.judge`` judges both.
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
    from nvscope.view.fields.can import CAN_FIELDS  # noqa: PLC0415

    return CAN_FIELDS


def _lines() -> MakeLines:
    from nvscope.view.lines.can_line import CanLineWriter  # noqa: PLC0415

    return CanLineWriter


def _tree() -> MakeTree:
    from nvscope.view.lines.can_tree import CanTree  # noqa: PLC0415

    return CanTree


def _findings() -> Sequence[FindingKind]:
    from nvscope.findings import can, can_bus, cob_ids  # noqa: PLC0415
    from nvscope.findings.catalogue import rows_of  # noqa: PLC0415

    return [kind for theme in (cob_ids, can, can_bus) for kind in rows_of(theme)]


CAN = Protocol(name="can", title="CAN", fields=_fields, lines=_lines, tree=_tree, findings=_findings)
