"""A block of the kernel's packet ring, as Linux lays it out (``linux/if_packet.h``, TPACKET_V3), and its packets.

::

    block   version u32 | private u32 | status u32 | packets u32 | first u32 | length u32 | sequence u64 | times
    packet  next u32 | seconds u32 | ns u32 | captured u32 | original u32 | status u32 | mac u16 | net u16
            hash u32 | VLAN tag u32 | VLAN type u16 | 10 bytes | sockaddr_ll | room | captured bytes at ``mac``

``next`` counts from the header that holds it, and is 0 in the last one of a block; ``first`` counts from the block.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from msgspec import Struct

from dissectors.batch import I32, I64, U8, Bool, Direction, LinkType, PacketBatch
from nvscope.capture.can.frame import FD_FRAME, KNOWN_FD_FLAGS
from nvscope.capture.lockstep import LockstepWalker

STATUS_AT = 8
"""Where a block tells whose it is: 0 the kernel's, else with the bit ``TO_READ`` the program's."""

TO_READ = 1

COUNT_AT = 12
"""Where a block tells how many packets it has."""

_FIRST_AT, _LENGTH_AT = 16, 20
_HEADER_BYTES = 48
_ADDRESS_BYTES = 20
_PACKET_TYPE_AT = _HEADER_BYTES + 10
_OUTGOING = 4
_VLAN_VALID, _VLAN_TYPE_VALID = 1 << 4, 1 << 6
VLAN_BYTES = 4
_MAC_BYTES = 12
_DOT1Q = 0x8100
_ALIGNMENT = 4
_CAN_HEAD_BYTES, _CAN_FLAGS_AT = 8, 5
_CAN_BYTES, _CAN_FD_BYTES = _CAN_HEAD_BYTES + 8, _CAN_HEAD_BYTES + 64
_FEW_BLOCKS, _FEW_PACKETS = 4, 2048

_HEADER = np.dtype({
    "names": ["seconds", "ns", "captured", "original", "status", "mac", "vlan", "vlan_type", "direction"],
    "formats": ["u4", "u4", "u4", "u4", "u4", "u2", "u4", "u2", "u1"],
    "offsets": [4, 8, 12, 16, 20, 24, 32, 36, _PACKET_TYPE_AT],
    "itemsize": _HEADER_BYTES + _ADDRESS_BYTES,
})  # fmt: skip


class _Framing:
    """Where packets follow each other; likely headers share status and place of the bytes with the first one."""

    header_bytes = _HEADER.itemsize
    length_at = 0
    length_adds = 0
    byte_order = "="
    shortest = _HEADER.itemsize
    alignment = _ALIGNMENT

    def __init__(self, longest: int) -> None:
        self.longest = longest

    def needle(self, data: U8, start: int) -> tuple[int, tuple[int, ...]]:
        first, second = data[start + 20 : start + 28].view(np.uint32).tolist()
        return 20, (first, second)

    def plausible(self, data: U8, at: I64, start: int) -> Bool:
        headers, second = _headers(data, at), int(data[start + 4 : start + 8].view(np.uint32)[0])
        likely: Bool = np.abs(headers["seconds"].astype(np.int64) - second) < 3600
        likely &= headers["captured"] <= headers["original"]
        likely &= headers["ns"] < 1_000_000_000
        return likely


def _headers(data: U8, at: I64) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    size = _HEADER.itemsize
    # Void items are copied as one block; a structured type would be copied field by field.
    spans = np.ndarray((len(data) - size + 1,), f"V{size}", buffer=data, strides=(1,))
    headers: np.ndarray[tuple[int], np.dtype[np.void]] = spans[at].view(_HEADER)
    return headers


class BlockReader(Struct, frozen=True):
    """Makes columns of the packets of blocks of ``block_bytes``, which lie one after the other in ``data``.

    ``skip_outgoing``: of packets that the interface sends, nothing is wanted: on a loopback and on CAN they come back.
    CAN frames are brought into the order of link type 227.
    The kernel left ``VLAN_BYTES`` free in front of every packet, where tags that it had taken out are put back.
    """

    data: U8
    block_bytes: int
    link: int
    skip_outgoing: bool = False
    has_tags: bool = True

    def read(self, blocks: Sequence[int]) -> PacketBatch:
        """Return the packets of blocks that are the program's, over ``data``; tags are put back in there."""
        at = self._packets(blocks)
        if not len(at):
            return PacketBatch.nothing()
        headers = _headers(self.data, at)
        direction = headers["direction"]
        if self.skip_outgoing:
            kept = direction != _OUTGOING
            if not kept.all():
                at, headers, direction = at[kept], headers[kept], direction[kept]
        offset = at + headers["mac"]
        captured = headers["captured"].astype(np.int32)
        original = headers["original"].astype(np.int64)
        if self.has_tags:
            tagged = np.flatnonzero(headers["status"] & _VLAN_VALID)
            if len(tagged):
                self._put_back(tagged, headers, offset)
                offset[tagged] -= VLAN_BYTES
                captured[tagged] += VLAN_BYTES
                original[tagged] += VLAN_BYTES
        if self.link == LinkType.CAN_SOCKETCAN:
            self._to_network_order(offset, captured)
        ts_ns = np.multiply(headers["seconds"], 1_000_000_000, dtype=np.int64)
        ts_ns += headers["ns"]
        way = np.where(direction == _OUTGOING, Direction.TX, Direction.RX).astype(np.uint8)
        link = PacketBatch.link_column(self.link, len(at))
        return PacketBatch(self.data, offset, captured, original, ts_ns, link, direction=way)

    def _to_network_order(self, offset: I64, captured: I32) -> None:
        """Make of frames as Linux has them (``struct can_frame``, ``canfd_frame``) those of link type 227, in place.

        Which of both it is tells their size; flags that mean nothing may be anything.
        """
        place = offset[captured >= _CAN_HEAD_BYTES][:, None] + np.arange(4)
        self.data[place] = self.data[place].view(np.uint32).astype(">u4").view(np.uint8)
        is_fd = captured == _CAN_FD_BYTES
        flags = offset[is_fd] + _CAN_FLAGS_AT
        self.data[flags] = self.data[flags] & KNOWN_FD_FLAGS | FD_FRAME
        self.data[offset[is_fd][:, None] + np.arange(_CAN_FLAGS_AT + 1, _CAN_HEAD_BYTES)] = 0
        self.data[offset[captured == _CAN_BYTES] + _CAN_FLAGS_AT] = 0

    def _packets(self, blocks: Sequence[int]) -> I64:
        """Return where the headers of the packets of some blocks are."""
        begin = np.array(blocks, np.int64) * self.block_bytes
        words = self.data.view(np.uint32)
        count, first, length = (words[(begin + at) // 4].astype(np.int64) for at in (COUNT_AT, _FIRST_AT, _LENGTH_AT))
        full = np.flatnonzero(count)
        begin, count, first = begin[full], count[full], first[full]
        if not len(full):
            return begin
        if len(full) >= _FEW_BLOCKS and int(count.max()) <= _FEW_PACKETS:
            return self._side_by_side(begin + first, count)
        ends = np.minimum(length[full], self.block_bytes)
        return np.concatenate([self._walk(*one) for one in np.stack((begin, count, first, ends), 1).tolist()])

    def _walk(self, begin: int, count: int, first: int, length: int) -> I64:
        walker = LockstepWalker(
            self.data[: begin + self.block_bytes], begin + length, _Framing(self.block_bytes),
            record_bytes=(length - first) / count,
        )  # fmt: skip
        return walker.walk(begin + first, begin + length)[:count]

    def _side_by_side(self, start: I64, count: I64) -> I64:
        """Walk blocks of few packets, one step in all of them at a time: their beginnings are known."""
        steps = int(count.max())
        path = np.empty((steps, len(start)), np.int64)
        path[0] = start
        following = np.ndarray((len(self.data) - 3,), np.uint32, self.data, 0, (1,))
        rows = list(path)
        # The last packet of a block tells 0: there, a lane stays.
        for here, there in pairwise(rows):
            np.add(here, following[here], there)
        return path.T[np.arange(steps) < count[:, None]]

    def _put_back(self, rows: I64, headers: np.ndarray[tuple[int], np.dtype[np.void]], offset: I64) -> None:
        """Put VLAN tags between the addresses and the type of frames, where there is room in front of them."""
        moved = offset[rows][:, None] + np.arange(_MAC_BYTES)
        self.data[moved - VLAN_BYTES] = self.data[moved]
        told = headers[rows]
        known = (told["status"] & _VLAN_TYPE_VALID) != 0
        tag = np.empty((len(rows), 2), ">u2")
        tag[:, 0] = np.where(known, told["vlan_type"], _DOT1Q)
        tag[:, 1] = told["vlan"]
        place = offset[rows][:, None] + (_MAC_BYTES - VLAN_BYTES) + np.arange(VLAN_BYTES)
        self.data[place] = tag.view(np.uint8)
