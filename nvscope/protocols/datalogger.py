"""DataLogger: the rows of its databases, which stand among the packets of a capture, each at its time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nvscope.protocols.protocol import Protocol
from nvscope.tracker.datalogger.on_demand import NAME, DatabaseState, dissect

if TYPE_CHECKING:
    from dissectors.dissector import Dissector
    from nvscope.view.fields.field import TelegramField
    from nvscope.view.lines.moments import Moment
    from nvscope.view.lines.shown import LineMaker, Tree, Wording
    from nvscope.view.rows.frames import FrameRows


def _dissector() -> Dissector:
    from dissectors.batch import LinkType  # noqa: PLC0415
    from dissectors.claims import NO_CLAIMS  # noqa: PLC0415
    from dissectors.dissector import Dissector  # noqa: PLC0415

    return Dissector(NAME, NO_CLAIMS, dissect, own_link=LinkType.DATABASE_ROW)


def _fields() -> Sequence[TelegramField]:
    from nvscope.view.fields.datalogger import DATABASE_FIELDS  # noqa: PLC0415

    return DATABASE_FIELDS


def _lines(moment: Moment, width: int | None, wording: Wording) -> LineMaker:
    from nvscope.view.lines.row_line import RowLines  # noqa: PLC0415

    return RowLines(moment, width)


def _tree(rows: FrameRows, wording: Wording, *, dumps: bool) -> Tree:
    from nvscope.view.lines.row_tree import RowTree  # noqa: PLC0415

    return RowTree(rows, dumps=dumps)


DATALOGGER = Protocol(
    name=NAME,
    title="DataLogger",
    fields=_fields,
    lines=lambda: _lines,
    tree=lambda: _tree,
    dissector=_dissector,
    observe=DatabaseState,
)
