"""The packet blocks of a pcapng file as columns: enhanced, simple and obsolete ones."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from dissectors.batch import I64, U8, U32, U64, Bool
from nvscope.capture.pcapng.blocks import ENHANCED_PACKET, OBSOLETE_PACKET, SIMPLE_PACKET, BlockFraming

_UNKNOWN_DROPS = 0xFFFF


class PacketBlocks(Struct):
    """Packet blocks, whatever is in them, before their interfaces are looked up."""

    at: I64
    index: I64
    length: I64
    interface: I64
    captured: I64
    original: I64
    units: U64
    simple: Bool | None
    drops: I64 | None

    def __getitem__(self, rows: slice) -> PacketBlocks:
        return PacketBlocks(
            self.at[rows],
            self.index[rows],
            self.length[rows],
            self.interface[rows],
            self.captured[rows],
            self.original[rows],
            self.units[rows],
            None if self.simple is None else self.simple[rows],
            None if self.drops is None else self.drops[rows],
        )

    @staticmethod
    def of(framing: BlockFraming, data: U8, at: I64, words: U32, index: I64) -> PacketBlocks:
        """Return those of the blocks at ``index`` among some that begin ``at``, with their first four ``words``."""
        if len(index) != len(at):
            at, words = at[index], words[index]
        types = words[:, 0]
        more = framing.words(data, at + 16, 4)
        interface = words[:, 2].astype(np.int64)
        captured = more[:, 1].astype(np.int64)
        original = more[:, 2].astype(np.int64)
        units = (words[:, 3].astype(np.uint64) << np.uint64(32)) | more[:, 0]
        simple: Bool | None = None
        drops: I64 | None = None
        if not (types == ENHANCED_PACKET).all():
            obsolete = types == OBSOLETE_PACKET
            first, second = interface & 0xFFFF, interface >> 16
            if framing.byte_order == ">":
                first, second = second, first
            drops = np.where(obsolete & (second != _UNKNOWN_DROPS), second, 0)
            simple = types == SIMPLE_PACKET
            original = np.where(simple, interface, original)
            captured = np.where(simple, interface, captured)
            interface = np.where(obsolete, first, np.where(simple, 0, interface))
        length = words[:, 1].astype(np.int64)
        return PacketBlocks(at, index, length, interface, captured, original, units, simple, drops)
