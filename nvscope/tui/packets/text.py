"""What panes show of frames: their lines, trees and bytes, as ``nvscope packets`` writes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct

from dissectors.batch import Bool
from dissectors.carried import Carrier
from nvscope.list_key import ListKey
from nvscope.protocols.table import PROTOCOLS
from nvscope.protocols.visu import page_ports
from nvscope.view.lines.mixed_lines import MixedLines, line_makers
from nvscope.view.lines.moments import Moment
from nvscope.view.lines.shown import Spans, Wording
from nvscope.view.lines.table import Line
from nvscope.view.lines.tree import PlacedLine, Trees
from nvscope.view.lines.tree_lines import VARIABLES
from nvscope.view.rows.frames import FrameRows

if TYPE_CHECKING:
    from nvscope.analysis.watching import Scene


class ShownFrame(Struct, frozen=True):
    """A frame as panes show it: its number, tree and bytes.

    ``changed`` tells which bytes are others than in the frame of its stream before, whose number is ``before``; both
    None where there is none that is known. ``list_key`` is the list that it is of.
    """

    number: int
    packet: bytes
    spans: Spans
    tree: Sequence[PlacedLine]
    before: int | None = None
    changed: Bool | None = None
    list_key: str | None = None


class _Newest:
    """Knows which CAN frames are CANopen's by the newest scene that was shown."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def of_frame(self, channel: int, cob_id: int, frame_number: int) -> bool:
        return self.scene.canopen.of_frame(channel, cob_id, frame_number)


class PacketText:
    """Makes the lines of frames of one session, which stay aligned however the list is moved."""

    def __init__(self, scene: Scene, moment: Moment, width: int | None) -> None:
        self._newest = _Newest(scene)
        inquiry = scene.inquiry
        names = inquiry.project.node_names if scene.node_names is None else scene.node_names
        self._wording = Wording(
            names, inquiry.layouts, inquiry.pdos, self._newest, inquiry.project.definition.parameters,
            page_ports=page_ports(inquiry.project.webvisu),
        )  # fmt: skip
        makers = line_makers({one.name: one.lines() for one in PROTOCOLS}, moment, width, self._wording)
        self._mixed = MixedLines(makers, width)
        self._trees = {one.name: one.tree() for one in PROTOCOLS}

    def lines(self, scene: Scene, rows: FrameRows) -> list[Line]:
        """Return a line a frame."""
        self._newest.scene = scene
        return list(self._mixed.lines(rows)) if len(rows) else []

    def frame(
        self, scene: Scene, rows: FrameRows, before: FrameRows | None, width: int, *, beside_bytes: bool
    ) -> ShownFrame:  # fmt: skip
        """Return the only frame of some rows; ``before`` is the one of its stream before, None for none."""
        self._newest.scene = scene
        trees = Trees(rows, self._trees, self._wording, width, dumps=False)
        spans, packet = trees.spans(0), rows.packets.packet(int(rows.row[0]))
        number, changed = None, None
        if before is not None and len(before):
            number = int(before.frame_number[0])
            there = Trees(before, self._trees, self._wording, dumps=False).spans(0)
            changed = changed_bytes(packet, spans, before.packets.packet(int(before.row[0])), there)
        if spans.hidden:
            # Passwords may be among the bytes.
            packet, changed = packet[: spans.start], None if changed is None else changed[: spans.start]
            spans = Spans(spans.start, spans.start, spans.start, hidden=True)
        return ShownFrame(
            int(rows.frame_number[0]), packet, spans, list(trees.placed_lines(0, beside_bytes=beside_bytes)), number,
            changed, _list_key(rows),
        )  # fmt: skip


def changed_bytes(packet: bytes, spans: Spans, before: bytes, there: Spans) -> Bool:
    """Tell which bytes of a frame are not those at the same place of another one, or are not there at all.

    Messages are compared from their beginning on, be the headers in front of them as long or not.
    """
    own, other = np.frombuffer(packet, np.uint8), np.frombuffer(before, np.uint8)
    changed = np.ones(len(own), np.bool_)
    for first, first_there, stop, stop_there in (
        (0, 0, spans.start, there.start),
        (spans.start, there.start, len(own), len(other)),
    ):
        count = min(stop - first, stop_there - first_there)
        changed[first : first + count] = own[first : first + count] != other[first_there : first_there + count]
    return changed


def _list_key(rows: FrameRows) -> str | None:
    carried = rows.carried
    if not carried.of_list[0]:
        return None
    carrier = Carrier(int(carried.carrier[0]))
    return str(ListKey.of(carrier, int(carried.port[0]), int(carried.identifier[0]), rows.channel))


def first_line(tree: Sequence[PlacedLine]) -> int:
    """Return where reading begins in a tree: at its first variable, else at what is behind its carriers."""
    own = [at for at, line in enumerate(tree) if not line.is_carrier]
    variables = next((at for at in own if tree[at].title == VARIABLES), None)
    if variables is not None:
        return min(variables + 1, len(tree) - 1)
    return own[0] if own else 0
