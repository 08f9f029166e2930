"""Frames in which no other protocol is found: ARP, ICMP, and what else is on the network.

They are read where all frames are wanted, and nowhere counted (``dissectors.other_frames``, ``Told.others``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nvscope.protocols.protocol import Protocol

if TYPE_CHECKING:
    from nvscope.view.fields.field import TelegramField
    from nvscope.view.lines.shown import MakeLines, MakeTree


def _fields() -> Sequence[TelegramField]:
    from nvscope.view.fields.other_frames import OTHER_FIELDS  # noqa: PLC0415

    return OTHER_FIELDS


def _lines() -> MakeLines:
    from nvscope.view.lines.other_line import OtherLines  # noqa: PLC0415

    return OtherLines


def _tree() -> MakeTree:
    from nvscope.view.lines.other_tree import OtherTree  # noqa: PLC0415

    return OtherTree


OTHER_FRAMES = Protocol(name="other", title="Other frames", fields=_fields, lines=_lines, tree=_tree)
