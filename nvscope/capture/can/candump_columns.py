"""Many lines of a candump log of one shape at once: every column of characters is a column of an array.

Lines have one shape if time, channel and identifier have the same numbers of characters and the same separators; data
may be of any length. A program writes a log in one or a few shapes. What fits no shape is left to ``candump_line``,
which decides alone what a line may be: a shape takes no line that it would refuse, and takes it as the same frame.
"""

from __future__ import annotations

import re

import numpy as np

from dissectors.batch import I64, PAD_BYTES, U8, U64, Bool, Records
from nvscope.capture.can.frame import CLASSIC_WORDS, FD_FRAME, FD_WORDS, HEAD_BYTES, KNOWN_FD_FLAGS, CanRows
from nvscope.capture.digits import ZEROS, decimal, hexadecimal, last_characters
from nvscope.capture.time_span import TIME_LIMIT_NS

_MAX_NAMES = 64
_DATA_CHARACTERS = 16
_FD_CHARACTERS = 128
_PREFIX = re.compile(
    rb"\((\d{1,10})\.(\d{1,9})\)[ \t]+(\S{1,32})[ \t]+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#([0-9A-Fa-f])(?!\.))?"
)


def _keep(characters: int) -> U64:
    """Return for 0 to ``characters`` characters which bits of the words that hold them are theirs."""
    words = characters // 8
    table = np.zeros((characters + 1, words * 8), np.uint8)
    for count in range(characters + 1):
        table[count, :count] = 0xFF
    masks: U64 = table.view(np.uint64)
    return masks


_KEEP = _keep(_DATA_CHARACTERS)
_KEEP_FD = _keep(_FD_CHARACTERS)
_ZEROS = np.uint64(ZEROS)

# FD flags of a character, 0 for what is no hexadecimal digit.
_FD_FLAGS = np.zeros(256, np.uint32)
for _digit in b"0123456789abcdefABCDEF":
    _FD_FLAGS[_digit] = int(chr(_digit), 16) & KNOWN_FD_FLAGS | FD_FRAME

# Bits of the identifier's four bytes, the first one lowest.
_ERROR_BIT = np.uint64(0x20)
_BEYOND_EXTENDED = np.uint64(0xC0)
_BEYOND_STANDARD = np.uint64(0x08_0000)


class Shape:
    """One shape of lines, and the channels that were met in it.

    ``hits`` are the lines it took of the last stretch.
    """

    def __init__(self, like: Prefix) -> None:
        self.key = like.key
        prefix = like.match
        text = prefix[0]
        self._seconds_at, self._seconds = prefix.start(1), len(prefix[1])
        self._fraction_at, self._fraction = prefix.start(2), len(prefix[2])
        self._channel_at, self._channel = prefix.start(3), len(prefix[3])
        self._identifier_at, self._identifier = prefix.start(4), len(prefix[4])
        self._is_fd = prefix[5] is not None
        self._end = len(text)
        self._block = (len(text) + _DATA_CHARACTERS + 7) // 8 * 8
        free = bytearray(len(text))
        for group in (1, 2, 3, 4, 5):
            begin, end = prefix.span(group)
            free[max(begin, 0) : max(end, 0)] = b"\1" * max(end - begin, 0)
        fixed = bytes(0 if is_free else 0xFF for is_free in free).ljust(self._block, b"\0")
        mask = np.frombuffer(fixed, np.uint64)
        wanted = np.frombuffer(text.ljust(self._block, b"\0"), np.uint64) & mask
        self._fixed = [(8 * n, mask[n], wanted[n]) for n in np.flatnonzero(mask).tolist()]
        self._names: list[tuple[list[np.uint64], int]] = []
        self.hits = 0

    def know(self, name: bytes, number: int) -> bool:
        """Take lines of one more channel, ``name`` being as long as the shape's; tell whether that is news."""
        if len(self._names) >= _MAX_NAMES or any(number == known for _, known in self._names):
            return False
        padded = name.ljust((len(name) + 7) // 8 * 8, b"\0")
        self._names.append((list(np.frombuffer(padded, np.uint64)), number))
        return True

    def take(self, data: U8, start: I64, length: I64) -> tuple[CanRows, Bool | None]:
        """Return the frames of those lines at ``start`` that are of the shape, and which ones they are, None for all.

        Of each line ``length`` characters count, those before the direction, which is left to be filled in. At least
        ``PAD_BYTES`` bytes follow each start.
        """
        chosen: Bool | None = None
        block = _gather(data, start, self._block)
        other = np.zeros(len(start), np.uint64)
        for at, mask, wanted in self._fixed:
            other |= (_words(block, at) ^ wanted) & mask
        fits: Bool = (other == 0) & (length >= self._end)
        if not fits.all():
            chosen = fits
            fitting = np.flatnonzero(fits)
            if not len(fitting):
                return CanRows.empty(0), chosen
            block, start, length = block[fitting], start[fitting], length[fitting]
        rows, wrong, channel_known = self._decode(data, block, start, length)
        good = (wrong == 0) & channel_known
        if not good.all():
            rows = rows[good]
            if chosen is None:
                chosen = good
            else:
                chosen[np.flatnonzero(chosen)[~good]] = False
        return rows, chosen

    def _decode(self, data: U8, block: Records, start: I64, length: I64) -> tuple[CanRows, U64, Bool]:
        """Return the frames of lines of the shape, what is not 0 where they are wrong, and whose channel is known."""
        ts_ns, wrong = self._times(block)
        word = last_characters(_words(block, self._identifier_at), self._identifier)
        identifier, bad = hexadecimal(word)
        wrong |= bad
        if self._identifier == 3:
            wrong |= identifier & _BEYOND_STANDARD
        else:
            wrong |= identifier & _BEYOND_EXTENDED
            # 29 bits are an extended identifier, unless they are the class of an error.
            identifier |= (~(identifier & _ERROR_BIT) & _ERROR_BIT) << np.uint64(2)
        characters = length - self._end
        most = _FD_CHARACTERS if self._is_fd else _DATA_CHARACTERS
        wrong |= ((characters > most) | (characters & 1 != 0)).astype(np.uint64)
        characters = np.minimum(characters, most)
        size = characters >> 1
        frames = np.empty((len(start), FD_WORDS if self._is_fd else CLASSIC_WORDS), np.uint32)
        frames[:, 0] = identifier
        frames[:, 1] = size
        if self._is_fd:
            flags = _FD_FLAGS[np.ndarray((len(start),), np.uint8, block, self._end - 1, (block.itemsize,))]
            wrong |= flags == 0
            frames[:, 1] |= flags << np.uint32(8)
            wrong |= _hexadecimal_fd(data, start + self._end, characters, frames)
        else:
            keep = _KEEP[characters]
            for part in range(2):
                word = _words(block, self._end + 8 * part)
                word = ((word ^ _ZEROS) & keep[:, part]) ^ _ZEROS
                frames[:, 2 + part], bad = hexadecimal(word)
                wrong |= bad
        channel, known = self._channels(block)
        captured = (size + HEAD_BYTES).astype(np.int32)
        unknown = np.zeros(len(start), np.uint8)
        return CanRows(frames, captured, captured.astype(np.int64), ts_ns, channel, unknown), wrong, known

    def _times(self, block: Records) -> tuple[I64, U64]:
        low = min(self._seconds, 8)
        seconds, wrong = decimal(last_characters(_words(block, self._seconds_at + self._seconds - low), low))
        if self._seconds > 8:
            high = self._seconds - 8
            more, bad = decimal(last_characters(_words(block, self._seconds_at), high))
            wrong |= bad
            seconds = seconds + more * np.uint64(100_000_000)
        digits = min(self._fraction, 8)
        fraction, bad = decimal(last_characters(_words(block, self._fraction_at), digits))
        wrong |= bad
        fraction = fraction * np.uint64(10 ** (9 - digits))
        if self._fraction == 9:
            last = last_characters(_words(block, self._fraction_at + 8), 1)
            units, bad = decimal(last)
            wrong |= bad
            fraction = fraction + units
        # Ten digits of seconds are less than 2^64 nanoseconds.
        ts_ns = seconds * np.uint64(1_000_000_000) + fraction
        wrong |= ts_ns > TIME_LIMIT_NS
        return ts_ns.astype(np.int64), wrong

    def _channels(self, block: Records) -> tuple[np.ndarray[tuple[int], np.dtype[np.uint16]], Bool]:
        number = np.zeros(len(block), np.uint16)
        known = np.zeros(len(block), np.bool_)
        texts = []
        for at in range(0, self._channel, 8):
            word = _words(block, self._channel_at + at)
            rest = self._channel - at
            texts.append(word & np.uint64((1 << 8 * rest) - 1) if rest < 8 else word)
        for name, channel in self._names:
            same: Bool = texts[0] == name[0]
            for text, part in zip(texts[1:], name[1:], strict=True):
                same &= text == part
            known |= same
            if channel:
                number[same] = channel
        return number, known


class Prefix:
    """What comes before the data in a line that may have a shape; lines of one ``key`` are of one shape."""

    def __init__(self, match: re.Match[bytes]) -> None:
        self.match = match
        self.channel = match[3]
        line = match.string
        self.key = (
            match.end(1),
            match.end(2),
            line[match.end(2) : match.start(3)],
            match.end(3),
            line[match.end(3) : match.start(4)],
            match.end(4),
            match[5] is not None,
        )

    @staticmethod
    def of(line: bytes) -> Prefix | None:
        """Return the prefix of a line, or None where it has no shape that is worth it."""
        match = _PREFIX.match(line)
        if not match or match.end() + _DATA_CHARACTERS + 8 > PAD_BYTES:
            return None
        return Prefix(match)


def _gather(data: U8, start: I64, size: int) -> Records:
    """Return ``size`` bytes from each start, as one item each."""
    spans: Records = np.ndarray((len(data) - size + 1,), f"V{size}", buffer=data, strides=(1,))
    block: Records = spans[start]
    return block


def _words(block: Records, at: int) -> U64:
    """Return eight bytes of each item, from byte ``at``, as a column of its own."""
    column: U64 = np.ndarray((len(block),), "<u8", buffer=block, offset=at, strides=(block.itemsize,))
    return column.copy()


def _hexadecimal_fd(
    data: U8, at: I64, characters: I64, frames: np.ndarray[tuple[int, int], np.dtype[np.uint32]]
) -> U64:
    """Fill in the data of FD frames; return what is not 0 where they are wrong."""
    inside = at + _FD_CHARACTERS <= len(data)
    words: U64 = _gather(data, np.where(inside, at, 0), _FD_CHARACTERS).view("<u8").reshape(-1, _FD_CHARACTERS // 8)
    words = ((words ^ _ZEROS) & _KEEP_FD[characters]) ^ _ZEROS
    frames[:, 2:], bad = hexadecimal(words)
    wrong: U64 = np.bitwise_or.reduce(bad, axis=1)
    wrong |= ~inside
    return wrong
