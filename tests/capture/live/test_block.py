"""Blocks of the kernel's ring for a CAN interface, built as ``linux/if_packet.h`` and ``linux/can.h`` have them."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from dissectors.batch import PAD_BYTES, LinkType
from dissectors.can.frame import dissect_can
from nvscope.capture.live.block import BlockReader

_INCOMING, _OUTGOING = 0, 4
_FIRST, _HEAD, _MAC = 48, 48, 96


def _frame(word: int, length: int, flags: int, data: bytes, room: int) -> bytes:
    """Return a ``struct can_frame`` (room for 8) or ``canfd_frame`` (for 64), in the order of this machine."""
    return struct.pack("=IBBBB", word, length, flags, 0, 0) + data.ljust(room, b"\0")


def _block(frames: Sequence[tuple[int, bytes]]) -> np.ndarray[tuple[int], np.dtype[np.uint8]]:
    """Return a block with frames and which way each went."""
    packets = []
    for number, (way, data) in enumerate(frames):
        size = -(-(_MAC + len(data)) // 4) * 4
        following = size if number + 1 < len(frames) else 0
        header = struct.pack("=IIIIIIHH", following, 1_700_000_000, number, len(data), len(data), 1, _MAC, _MAC)
        address = struct.pack("=HHiHBB8s", 17, 0x0C00, 3, 280, way, 0, b"")
        packets.append((header.ljust(_HEAD, b"\0") + address).ljust(_MAC, b"\0") + data.ljust(size - _MAC, b"\0"))
    body = b"".join(packets)
    head = struct.pack("=IIIIIIQ", 1, 0, 1, len(frames), _FIRST, _FIRST + len(body), 1).ljust(_FIRST, b"\0")
    return np.frombuffer(bytearray(head + body + bytes(2 * PAD_BYTES)), np.uint8)


def test_frames_of_a_can_interface_are_those_of_link_type_227() -> None:
    extended, remote, error = 1 << 31, 1 << 30, 1 << 29
    block = _block(
        [
            (_INCOMING, _frame(0x123, 3, 0xAA, b"abc", 8)),  # the byte of the flags means nothing in a classic frame
            (_OUTGOING, _frame(0x124, 1, 0, b"x", 8)),  # comes back as an incoming one
            (_INCOMING, _frame(0x124, 1, 0, b"x", 8)),
            (_INCOMING, _frame(extended | 0x1ABCDE0, 12, 0x01, b"twelve bytes", 64)),
            (_INCOMING, _frame(extended | remote | 0x55, 8, 0, b"", 8)),
            (_INCOMING, _frame(error | 0x40, 8, 0, b"", 8)),
        ]
    )
    reader = BlockReader(block, len(block) - 2 * PAD_BYTES, LinkType.CAN_SOCKETCAN, skip_outgoing=True, has_tags=False)
    frames = dissect_can(reader.read([0]))
    assert not frames.fault.any()
    assert frames.identifier.tolist() == [0x123, 0x124, 0x1ABCDE0, 0x55, 0x40]
    assert frames.extended.tolist() == [False, False, True, True, False]
    assert frames.remote.tolist() == [False, False, False, True, False]
    assert frames.error.tolist() == [False, False, False, False, True]
    assert (frames.fd.tolist(), frames.brs.tolist()) == ([False, False, True, False, False],) * 2
    assert [frames.payload(place) for place in range(3)] == [b"abc", b"x", b"twelve bytes"]
