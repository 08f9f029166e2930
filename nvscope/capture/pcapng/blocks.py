"""pcapng files, as of draft-ietf-opsawg-pcapng.

::

    block        type u32 | total length u32 | body, padded to 4 | total length u32
    section      magic u32 | major u16 | minor u16 | section length i64 | options
    interface    link type u16 | reserved u16 | snap length u32 | options
    enhanced     interface u32 | time high u32 | time low u32 | captured u32 | original u32 | bytes, padded | options
    obsolete     interface u16 | drops u16, then like enhanced
    simple       original u32 | bytes, padded
    statistics   interface u32 | time high u32 | time low u32 | options
    option       code u16 | length u16 | value, padded to 4

Every section has a byte order, which its magic tells, and its own interfaces, numbered from 0 as they come.
"""

from __future__ import annotations

import struct
import sys

import numpy as np

from dissectors.batch import I64, U8, U32, Bool
from nvscope.capture.record_reader import MAX_SNAP_BYTES

SECTION = 0x0A0D0D0A
INTERFACE = 1
OBSOLETE_PACKET = 2
SIMPLE_PACKET = 3
STATISTICS = 5
ENHANCED_PACKET = 6

BYTE_ORDER_MAGIC = 0x1A2B3C4D
# The section's magic as bytes → byte order.
BYTE_ORDERS: dict[bytes, str] = {struct.pack(order + "I", BYTE_ORDER_MAGIC): order for order in "<>"}

# Fewest bytes of a block of each type, both lengths included.
FEWEST_BYTES = {SECTION: 28, INTERFACE: 20, STATISTICS: 24}
PACKET_OVERHEAD = 32
SIMPLE_OVERHEAD = 16

OPTION_END = 0
OPTION_COMMENT = 1
OPTION_INTERFACE_NAME = 2
OPTION_TIME_RESOLUTION = 9
OPTION_TIME_OFFSET = 14
OPTION_PACKET_FLAGS = 2
OPTION_PACKET_DROPS = 4
OPTION_INTERFACE_DROPS = 5
OPTION_SYSTEM_DROPS = 7

MAX_BLOCK_BYTES = MAX_SNAP_BYTES + (1 << 20)


class BlockFraming:
    """Where blocks follow each other; a likely packet block has the type of the one before, and its length twice."""

    header_bytes = 8
    length_at = 4
    length_adds = 0
    shortest = 12
    longest = MAX_BLOCK_BYTES
    alignment = 4

    def __init__(self, byte_order: str) -> None:
        self.byte_order = byte_order
        self.packet_type = ENHANCED_PACKET

    def words(self, data: U8, at: I64, count: int) -> U32:
        """Return ``count`` (1, 2 or 4) 32-bit words at each position, as (n, count)."""
        # Void items are copied as one block; a structured type would be copied field by field.
        spans = np.ndarray((max(len(data) - 4 * count + 1, 0),), f"V{4 * count}", buffer=data, strides=(1,))
        words: U32 = spans[at].view(self.byte_order + "u4").reshape(-1, count)
        return words

    def needle(self, data: U8, start: int) -> tuple[int, tuple[int, ...]]:
        return 0, (int.from_bytes(struct.pack(self.byte_order + "I", self.packet_type), sys.byteorder),)

    def plausible(self, data: U8, at: I64, start: int) -> Bool:
        length = self.words(data, at, 2)[:, 1].astype(np.int64)
        likely: Bool = (length >= self.shortest) & (length & 3 == 0) & (at + length <= len(data))
        last_word = np.where(likely, at + length - 4, at)
        likely &= self.words(data, last_word, 1)[:, 0] == length
        return likely
