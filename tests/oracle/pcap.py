"""Frames written as a pcap file."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

from tests.oracle.builders import SECOND
from tests.oracle.frame import ETHERNET, Frame


def write_pcap(
    frames: Iterable[Frame], path: Path | str, *, nanoseconds: bool = True, big_endian: bool = False
) -> None:
    """Write frames of one link type as a pcap file; microseconds cut the times."""
    frames = list(frames)
    links = {frame.link for frame in frames} or {ETHERNET}
    if len(links) > 1:
        raise ValueError("a pcap file has one link type")
    order = ">" if big_endian else "<"
    magic, unit = (0xA1B23C4D, 1) if nanoseconds else (0xA1B2C3D4, 1000)
    with open(path, "wb") as file:
        file.write(struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 262144, links.pop()))
        for frame in frames:
            seconds, rest = divmod(frame.ts_ns, SECOND)
            file.write(struct.pack(order + "IIII", seconds, rest // unit, len(frame.data), frame.original))
            file.write(frame.data)


def in_microseconds(frames: Iterable[Frame]) -> list[Frame]:
    """Return the frames with the times that a pcap file of microseconds keeps."""
    return [frame._replace(ts_ns=frame.ts_ns // 1000 * 1000) for frame in frames]
