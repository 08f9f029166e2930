"""Which way a CAN frame went: as the capture says, or else the header in front of it."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from dissectors.batch import Direction, LinkType, PacketBatch
from dissectors.can.frame import dissect_can
from tests.records import replace

FRAME = struct.pack("<IB3x", 0x123, 2) + b"\x11\x22".ljust(8, b"\0")


@pytest.mark.parametrize("link", [LinkType.LINUX_SLL, LinkType.LINUX_SLL2])
def test_a_cooked_header_tells_which_way_a_frame_went(link: int) -> None:
    """Unless the capture itself says it, packet by packet."""
    heads = []
    for kind in (0, 4, 4):
        if link == LinkType.LINUX_SLL:
            heads.append(struct.pack(">H12xH", kind, 0x000C))
        else:
            heads.append(struct.pack(">H8xB9x", 0x000C, kind))
    packets = PacketBatch.of([head + FRAME for head in heads], link)
    assert dissect_can(packets).direction.tolist() == [Direction.RX, Direction.TX, Direction.TX]
    told = replace(packets, direction=np.array([Direction.TX, Direction.RX, Direction.UNKNOWN], np.uint8))
    assert dissect_can(told).direction.tolist() == [Direction.TX, Direction.RX, Direction.TX]
