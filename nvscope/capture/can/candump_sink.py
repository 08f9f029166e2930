"""Writes candump logs, as ``candump -L`` does, by columns.

Lines of one width are written together: those of the same channel, kind of identifier, resolution and length.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import I64, U8, U32, Bool, Direction, PacketBatch
from dissectors.can.frame import MAX_DATA_BYTES, CanBatch, Fault, dissect_can
from nvscope.capture.can.frame import BIT_RATE_SWITCH, ERROR, ERROR_STATE
from nvscope.capture.output import FileSink
from nvscope.errors import UsageError

_DIRECTIONS = {Direction.UNKNOWN: b"", Direction.RX: b" R", Direction.TX: b" T"}
_S_NS, _US_NS = 1_000_000_000, 1_000
_SECOND_DIGITS = 10
_ROWS = 1 << 15
"""Lines at a time, so that their columns stay in the processor's cache."""

_HEX = np.frombuffer("".join(f"{byte:02X}" for byte in range(256)).encode(), np.uint8).reshape(256, 2)
_DECIMAL = np.frombuffer("".join(f"{number:04d}" for number in range(10_000)).encode(), np.uint8).reshape(10_000, 4)
_NIBBLE = np.frombuffer(b"0123456789ABCDEF", np.uint8)


class CandumpSink(FileSink):
    """Writes CAN frames to a candump log; ``channels`` are the names of their channels by number, else ``can0`` …

    Times have six decimals, or nine where there are nanoseconds; R or T ends a line where the direction is known. The
    names may grow while frames are written; blanks in them become ``_``. Raises UsageError for what is no CAN frame, or
    none that a line could tell whole.
    """

    format_name = "candump"

    def write(self, batch: PacketBatch) -> None:
        for start in range(0, len(batch), _ROWS):
            part = batch[start : start + _ROWS]
            frames = dissect_can(part)
            self._check(frames, len(part))
            self._output.write(self._lines(frames))
            self.packets += len(part)

    def _check(self, frames: CanBatch, rows: int) -> None:
        if rows and not len(frames):
            raise UsageError(
                "a candump log holds frames of CAN only", where=self._path, next_step="write a .pcapng or .pcap file"
            )
        good = np.zeros(rows, np.bool_)
        good[frames.row] = frames.fault == Fault.NONE
        if not good.all():
            number = self.packets + int(good.argmin()) + 1
            raise UsageError(
                f"frame {number} is no whole CAN frame, and a candump log holds no other",
                next_step="write a .pcapng file",
            )

    def _lines(self, frames: CanBatch) -> U8:
        """Return the lines of all frames, one behind the other."""
        kind = _kinds(frames)
        numbers, starts, group = np.unique(kind, return_index=True, return_inverse=True)
        order = np.argsort(group, kind="stable")
        ends = np.cumsum(np.bincount(group))
        width = np.zeros(len(numbers), np.int64)
        blocks = []
        for number, end, first in zip(range(len(numbers)), ends.tolist(), starts.tolist(), strict=True):
            rows = order[(ends[number - 1] if number else 0) : end]
            block = self._block(frames.take(rows), int(frames.channel[first]))
            width[number] = block.shape[1]
            blocks.append((rows, block))
        widths = width[group]
        after = np.cumsum(widths)
        text = np.empty(int(after[-1]) if len(after) else 0, np.uint8)
        for rows, block in blocks:
            size = block.shape[1]
            spans = np.ndarray((len(text) - size + 1,), f"V{size}", buffer=text, strides=(1,))
            spans[after[rows] - size] = block.view(f"V{size}")[:, 0]
        return text

    def _block(self, frames: CanBatch, channel: int) -> U8:
        """Return the lines of frames of one kind, shape (n, width)."""
        extended, error, fd = bool(frames.extended[0]), bool(frames.error[0]), bool(frames.fd[0])
        word = frames.identifier | np.uint32(ERROR if error else 0)
        parts: list[bytes | U8] = [b"(", *_time(frames.ts_ns), b") ", self._name(channel), b" "]
        parts += [_identifier(word, 8 if extended or error else 3), b"#"]
        length = int(frames.length[0])
        if frames.remote[0]:
            parts.append(b"R%X" % length if length else b"R")
        elif fd:
            flags = frames.brs * np.uint8(BIT_RATE_SWITCH) | frames.esi * np.uint8(ERROR_STATE)
            parts += [b"#", _NIBBLE[flags][:, np.newaxis]]
        if length and not frames.remote[0]:
            parts.append(_HEX[frames.data[frames.at[:, np.newaxis] + np.arange(length)]].reshape(len(frames), -1))
        if not fd and not error and int(frames.dlc[0]) > MAX_DATA_BYTES:
            parts += [b"_", _NIBBLE[frames.dlc][:, np.newaxis]]
        parts.append(_DIRECTIONS[Direction(int(frames.direction[0]))] + b"\n")
        block = np.empty((len(frames), sum(_width(part) for part in parts)), np.uint8)
        at = 0
        for part in parts:
            size = _width(part)
            block[:, at : at + size] = np.frombuffer(part, np.uint8) if isinstance(part, bytes) else part
            at += size
        return block

    def _name(self, channel: int) -> bytes:
        names = self._channels or ()
        name = names[channel] if channel < len(names) else ""
        return ("_".join(name.split()) or f"can{channel}").encode("utf-8", "backslashreplace")


def _kinds(frames: CanBatch) -> I64:
    """Return a number for each frame that is the same where lines are of one width and one form."""
    kind: I64 = frames.channel.astype(np.int64)
    told: tuple[U8 | Bool, ...] = (
        frames.extended, frames.error, frames.fd, frames.remote, frames.ts_ns < 0, frames.ts_ns % _US_NS != 0,
        frames.dlc > MAX_DATA_BYTES, frames.direction == Direction.RX, frames.direction == Direction.TX,
    )  # fmt: skip
    for column in told:
        kind = kind << 1 | column
    return kind << 7 | frames.length


def _width(part: bytes | U8) -> int:
    return len(part) if isinstance(part, bytes) else part.shape[1]


def _time(ts_ns: I64) -> list[bytes | U8]:
    """Return seconds and fraction of times of one sign and one resolution."""
    sign = [b"-"] if ts_ns[0] < 0 else []
    seconds, fraction = np.divmod(np.abs(ts_ns), _S_NS)
    if ts_ns[0] % _US_NS:
        return [*sign, _decimal(seconds, _SECOND_DIGITS), b".", _decimal(fraction, 9)]
    return [*sign, _decimal(seconds, _SECOND_DIGITS), b".", _decimal(fraction // _US_NS, 6)]


def _decimal(number: I64, digits: int) -> U8:
    """Return numbers with leading zeros, shape (n, digits)."""
    text = np.empty((len(number), digits), np.uint8)
    for end in range(digits, 0, -4):
        begin = max(end - 4, 0)
        number, low = np.divmod(number, 10_000)
        text[:, begin:end] = _DECIMAL[low, 4 - (end - begin) :]
    return text


def _identifier(word: U32, digits: int) -> U8:
    text: U8 = _HEX[word.astype(">u4").view(np.uint8).reshape(-1, 4)].reshape(len(word), 8)
    return text[:, 8 - digits :]
