"""CAN frames for tests: strategies for them, python-can's messages of them, and what our frames say."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

import can
import hypothesis.strategies as st

from dissectors.batch import LinkType
from nvscope.capture.source import Source

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
BASE_US = 1_436_509_052_000_000


class Frame(NamedTuple):
    """A frame taken to pieces. ``length`` of a remote frame is what it asks for.

    ``flags``: "x" extended, "r" remote, "e" error, "f" FD, "b" bit rate switch, "s" error state, in this order.
    """

    ts_ns: int
    channel: str
    identifier: int
    flags: str
    length: int
    data: bytes
    raw_dlc: int = 0


def unpacked(ts_ns: int, channel: str, raw: bytes) -> Frame:
    """Return what a SocketCAN frame says."""
    word, length, fd_flags, reserved, raw_dlc = struct.unpack(">IBBBB", raw[:8])
    assert not reserved
    bits = [(word, 1 << 31), (word, 1 << 30), (word, 1 << 29), (fd_flags, 4), (fd_flags, 1), (fd_flags, 2)]
    flags = "".join(letter for letter, (field, bit) in zip("xrefbs", bits, strict=True) if field & bit)
    return Frame(ts_ns, channel, word & 0x1FFF_FFFF, flags, length, raw[8:], raw_dlc)


def frames_of(source: Source) -> list[Frame]:
    """Read a source to its end."""
    frames = []
    for batch in source:
        if batch.ends and not len(batch):
            continue
        assert len(batch)
        assert batch.single_link == LinkType.CAN_SOCKETCAN
        assert int(batch.offset.max()) + 128 <= len(batch.data)
        for row in range(len(batch)):
            number = int(batch.channels[row])
            channel = source.channels[number] if source.channels else ""
            frame = unpacked(int(batch.ts_ns[row]), channel, batch.packet(row))
            assert int(batch.original[row]) == 8 + (0 if "r" in frame.flags else frame.length)
            frames.append(frame)
    return frames


def line_of(frame: Frame, *, decimals: int = 6, direction: str = "", lower: bool = False) -> str:
    """One line as candump writes it."""
    seconds, fraction = divmod(frame.ts_ns, 10**9)
    digits = f"{fraction:09d}"[:decimals]
    word = frame.identifier | (0x2000_0000 if "e" in frame.flags else 0)
    identifier = f"{word:08X}" if "x" in frame.flags or "e" in frame.flags else f"{word:03X}"
    if "r" in frame.flags:
        body = f"R{frame.length or ''}"
    else:
        body = frame.data.hex().upper()
        if "f" in frame.flags:
            body = f"#{('b' in frame.flags) + 2 * ('s' in frame.flags):X}{body}"
    if frame.raw_dlc:
        body += f"_{frame.raw_dlc:X}"
    line = f"({seconds:010d}.{digits}) {frame.channel} {identifier}#{body}"
    return (line.lower() if lower else line) + direction


def message_of(frame: Frame, channel: int | str | None) -> can.Message:
    return can.Message(
        timestamp=frame.ts_ns / 1e9,
        arbitration_id=frame.identifier,
        is_extended_id="x" in frame.flags,
        is_remote_frame="r" in frame.flags,
        is_error_frame="e" in frame.flags,
        channel=channel,
        dlc=frame.length,
        data=None if "r" in frame.flags else frame.data,
        is_fd="f" in frame.flags,
        bitrate_switch="b" in frame.flags,
        error_state_indicator="s" in frame.flags,
    )


@st.composite
def frames(
    draw: st.DrawFn, *, fd: bool = True, remote: bool = True, error: bool = True, channels: Sequence[str] = ("can0",)
) -> Frame:
    kinds = ["data"] * 6 + ["fd"] * fd + ["remote"] * remote + ["error"] * error
    kind = draw(st.sampled_from(kinds))
    extended = draw(st.booleans()) and kind != "error"
    identifier = draw(st.integers(0, 0x1FFF_FFFF if extended else 0x7FF))
    data = b""
    if kind == "data":
        data = draw(st.binary(max_size=8))
    elif kind == "error":
        data = draw(st.binary(min_size=8, max_size=8))
    elif kind == "fd":
        size = draw(st.sampled_from(FD_LENGTHS))
        data = draw(st.binary(min_size=size, max_size=size))
    flags = "x" * extended + {"data": "", "fd": "f", "remote": "r", "error": "e"}[kind]
    return Frame(
        1000 * draw(st.integers(BASE_US, BASE_US + 10**8)),
        draw(st.sampled_from(channels)),
        identifier,
        flags + (draw(st.sampled_from(("", "b", "s", "bs"))) if kind == "fd" else ""),
        draw(st.integers(0, 8)) if kind == "remote" else len(data),
        data,
        draw(st.sampled_from((0, 9, 12, 15))) if kind == "data" and len(data) == 8 else 0,
    )
