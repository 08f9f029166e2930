"""How many bits a CAN frame takes on the wire, from the start of frame to the end of the interframe space.

Sources: Bosch CAN 2.0 (1991), part B, sections 3 and 5; ISO 11898-1:2015 for CAN FD; the worst case of classic frames
from Davis, Burns, Bril, Lukkien: Controller Area Network schedulability analysis, Real-Time Systems 35 (2007),
equations 1 to 3. ``canbusload`` of can-utils (2020.11) counts classic data frames in the same way; early versions have
a smaller worst case, by Tindell, (269 + 48 n) / 5 and (389 + 48 n) / 5, which overlooks that a stuff bit begins a run.

::

    standard SOF 1 | identifier 11 | RTR IDE r0 3 | DLC 4 | data 8 n | CRC 15 | delimiter ACK delimiter 3 | EOF 7, IFS 3
    extended SOF 1 | base 11 | SRR IDE 2 | identifier 18 | RTR r1 r0 3 | DLC 4 | as above
    FD       SOF 1 | identifier 11 | RRS IDE FDF res BRS 5 | fast: ESI 1 | DLC 4 | data 8 n | stuff count 4 |
             CRC 17 or 21 | fixed stuff bits 6 or 7 | delimiter 1 | nominal: ACK, delimiter 2 | EOF 7 | IFS 3

Stuffing runs from SOF to the last bit of the CRC; in CAN FD to the last bit of the data, where the fixed stuff bit in
front of the stuff count takes the place of one that is due there.
"""

from __future__ import annotations

from enum import Enum
from functools import cache
from typing import NamedTuple

import numpy as np

from dissectors.batch import I64, U8, U16, U64, Bool
from dissectors.can.frame import DLC_OF_LENGTH, FD_LENGTHS, MAX_DATA_BYTES, MAX_FD_DATA_BYTES, CanBatch, Fault
from dissectors.layout import gather_bytes

HEAD_BITS, HEAD_BITS_EXTENDED = 19, 39
"""Bits in front of the data of a classic frame."""
TAIL_BITS = 15 + 3 + 7 + 3
"""Bits behind the data of a classic frame: CRC, delimiters and ACK, end of frame, interframe space."""

FD_ARBITRATION_BITS, FD_ARBITRATION_BITS_EXTENDED = 17, 36
"""Bits of an FD frame up to the bit rate switch."""
FD_CONTROL_BITS = 5
"""ESI and DLC."""
FD_TAIL_BITS = 2 + 7 + 3
"""Bits behind the CRC delimiter of an FD frame, at the nominal bit rate again."""
FD_CRC_BITS, FD_LONG_CRC_BITS = 4 + 17 + 6 + 1, 4 + 21 + 7 + 1
"""Stuff count, CRC, fixed stuff bits and delimiter, of up to 16 bytes of data and of more."""
FD_SHORT_CRC_BYTES = 16

_CHUNK = 1 << 14
"""Frames at a time, so that the columns in work stay in the processor's cache."""
_CRC_POLYNOMIAL = 0x4599
_PAD = 0x5555_5555_5555_5555_5555_5555_5555_5555


class Stuffing(Enum):
    """How stuff bits are counted.

    EXACT counts those that the bits of the frame need. WORST is the most that a frame of this length can need, and what
    ``canbusload`` shows unless told otherwise; NONE leaves them out, except for the fixed ones of CAN FD.
    """

    NONE = "none"
    EXACT = "exact"
    WORST = "worst"


class WireBits(NamedTuple):
    """Bits on the wire, per frame, uint16: at the nominal bit rate, and at the data bit rate of CAN FD."""

    nominal: U16
    fast: U16


def wire_bits(frames: CanBatch, stuffing: Stuffing) -> WireBits:
    """Count the bits of every frame, both columns of shape (n,).

    An error frame has 0: what destroyed a frame is not in it. So have frames of which no length is known (faults SHORT
    and XL). A remote frame has no data, whatever its length says (``canbusload`` counts that much data). ``fast`` is
    not 0 only in an FD frame with a bit rate switch. With EXACT, a frame whose data was not captured whole counts as
    the worst.
    """
    nominal, fast = np.zeros(len(frames), np.uint16), np.zeros(len(frames), np.uint16)
    known = ~frames.error & (frames.fault != Fault.SHORT) & (frames.fault != Fault.XL)
    classic = known & ~frames.fd
    if classic.all():
        return WireBits(_classic_bits(frames, stuffing), fast)
    rows = np.flatnonzero(classic)
    nominal[rows] = _classic_bits(frames.take(rows), stuffing)
    rows = np.flatnonzero(known & frames.fd)
    if len(rows):
        nominal[rows], fast[rows] = _fd_bits(frames.take(rows), stuffing)
    return WireBits(nominal, fast)


def _classic_bits(frames: CanBatch, stuffing: Stuffing) -> U16:
    data_bytes = np.minimum(frames.length, np.uint8(MAX_DATA_BYTES))
    data_bytes[frames.remote] = 0
    head = np.where(frames.extended, np.uint16(HEAD_BITS_EXTENDED), np.uint16(HEAD_BITS))
    bits: U16 = (head + data_bytes * np.uint16(8) + np.uint16(TAIL_BITS)).astype(np.uint16)
    if stuffing is Stuffing.NONE:
        return bits
    if stuffing is Stuffing.WORST:
        return bits + (head + data_bytes * np.uint16(8) + np.uint16(15 - 1)) // np.uint16(4)
    for first in range(0, len(frames), _CHUNK):
        part = slice(first, first + _CHUNK)
        bits[part] += _classic_stuff_bits(frames.take(part), data_bytes[part])
    cut = np.flatnonzero(frames.captured < data_bytes)
    if len(cut):
        bits[cut] = _classic_bits(frames.take(cut), Stuffing.WORST)
    return bits


def _classic_stuff_bits(frames: CanBatch, data_bytes: U8) -> U16:
    """Count the stuff bits of classic frames.

    A frame up to its data is a number of up to 103 bits, in two halves, whatever its length: its last bit is bit 0.
    Zeros in front of it leave the CRC alone; for stuffing, alternating bits in front of it start no run.
    """
    identifier = frames.identifier.astype(np.uint64)
    head = (identifier << np.uint64(7)) | (frames.remote.astype(np.uint64) << np.uint64(6))
    extended = frames.extended
    any_extended = bool(extended.any())
    if any_extended:
        wide = ((identifier >> np.uint64(18)) << np.uint64(27)) | np.uint64(0b11 << 25)
        wide |= (identifier & np.uint64(0x3FFFF)) << np.uint64(7)
        wide |= head & np.uint64(1 << 6)
        head = np.where(extended, wide, head)
    head |= frames.dlc
    data = gather_bytes(frames.data, frames.at, MAX_DATA_BYTES).view(">u8").astype(np.uint64)
    data_bits = data_bytes * np.uint64(8)
    rest = np.uint64(64) - data_bits  # numpy shifts by 64 to 0
    low = (data >> rest) | (head << data_bits)
    high = head >> rest
    count = 7 if any_extended else 6
    crc = _crc(_words(high, low, count))
    pad_low, pad_high = _pads()
    shape = data_bytes + extended * np.uint8(MAX_DATA_BYTES + 1)
    words = _words(high | pad_high.take(shape), low | pad_low.take(shape), count)
    # The CRC has 15 bits; one more, unlike its last, makes a word of it and starts no run that counts.
    words.append((crc << 1) | (~crc & 1))
    return _stuff_bits(words)[0]


def _words(high: U64, low: U64, count: int) -> list[I64]:
    """Cut numbers of 128 bits into words of 16 bits, the ``count`` last ones, first the highest."""
    halves = [number.astype("<u8").view("<u2").reshape(-1, 4) for number in (low, high)]
    return [halves[position // 4][:, position % 4].astype(np.int64) for position in range(count - 1, -1, -1)]


@cache
def _pads() -> tuple[U64, U64]:
    """The lower and upper halves of the alternating bits in front of a frame: by bytes of data, then extended."""
    pads = []
    for head_bits in (HEAD_BITS, HEAD_BITS_EXTENDED):
        pads += [(_PAD << (head_bits + 8 * size)) % (1 << 128) for size in range(MAX_DATA_BYTES + 1)]
    low = [pad % (1 << 64) for pad in pads]
    return np.array(low, np.uint64), np.array([pad >> 64 for pad in pads], np.uint64)


@cache
def _crc_table() -> I64:
    """The CRC-15 of every word of 16 bits, shape (65536,).

    A CRC is linear: that of a word is the exclusive or of those of its bits.
    """
    table = np.zeros(1 << 16, np.int64)
    single = _CRC_POLYNOMIAL
    for bit in range(16):
        table[1 << bit : 2 << bit] = table[: 1 << bit] ^ single
        single <<= 1
        if single >> 15:
            single = (single & 0x7FFF) ^ _CRC_POLYNOMIAL
    return table


def _crc(words: list[I64]) -> I64:
    table = _crc_table()
    crc = table.take(words[0])
    for word in words[1:]:
        crc <<= 1
        crc ^= word
        crc = table.take(crc)
    return crc


@cache
def _stuff_table() -> U8:
    """What every word of 16 bits does to a run, shape (8 × 65536,), by state and word.

    A state is the last bit (bit 2) and how often it came, less 1 (bits 0 and 1): four at most, for after the fifth the
    stuff bit begins a new run. An entry is the new state, and from bit 3 on how many stuff bits came.
    """
    state, byte = np.divmod(np.arange(8 << 8), 1 << 8)
    last, run, stuffed = state >> 2, (state & 3) + 1, np.zeros(8 << 8, np.int64)
    for position in range(7, -1, -1):
        bit = (byte >> position) & 1
        run = np.where(bit == last, run + 1, 1)
        due = run == 5
        last, run = np.where(due, 1 - bit, bit), np.where(due, 1, run)
        stuffed += due
    after = ((last << 2) | (run - 1)).astype(np.uint8).reshape(8, 256)
    count = stuffed.astype(np.uint8).reshape(8, 256)
    # the second byte starts in the state that the first one leaves
    entry = after[after] | ((count[:, :, np.newaxis] + count[after]) << np.uint8(3))
    return np.ascontiguousarray(entry).reshape(-1)


_IDLE = 0b100
"""The state to start in: a recessive bit, so that neither alternating bits nor a start of frame go on with a run."""


def _stuff_bits(words: list[I64]) -> tuple[U16, U8]:
    """Count the stuff bits of sequences given as words; return the counts and the states at the end."""
    table = _stuff_table()
    entry = table.take(words[0] | (_IDLE << 16))
    total = (entry >> np.uint8(3)).astype(np.uint16)
    for word in words[1:]:
        index = (entry & np.uint8(7)).astype(np.int64)
        index <<= 16
        index |= word
        entry = table.take(index)
        total += entry >> np.uint8(3)
    return total, entry & np.uint8(7)


def _fd_bits(frames: CanBatch, stuffing: Stuffing) -> WireBits:
    dlc = DLC_OF_LENGTH[np.minimum(frames.length, MAX_FD_DATA_BYTES)]
    data_bits = np.array(FD_LENGTHS, np.uint16)[dlc] * np.uint16(8)
    extended = frames.extended
    arbitration = np.where(extended, np.uint16(FD_ARBITRATION_BITS_EXTENDED), np.uint16(FD_ARBITRATION_BITS))
    crc = np.where(data_bits > 8 * FD_SHORT_CRC_BYTES, np.uint16(FD_LONG_CRC_BITS), np.uint16(FD_CRC_BITS))
    nominal = arbitration + np.uint16(FD_TAIL_BITS)
    fast = data_bits + np.uint16(FD_CONTROL_BITS) + crc
    if stuffing is not Stuffing.NONE:
        # A stuff bit behind the bit rate switch is a fast one; none comes behind the last bit of the data.
        early = (arbitration - np.uint16(2)) // np.uint16(4)
        total = (arbitration + np.uint16(FD_CONTROL_BITS) + data_bits - np.uint16(2)) // np.uint16(4)
        if stuffing is Stuffing.EXACT:
            for size in np.unique(dlc).tolist():
                for wide in (False, True):
                    rows = np.flatnonzero((dlc == size) & (extended == wide) & (frames.captured >= frames.length))
                    if len(rows):
                        early[rows], total[rows] = _fd_stuff_bits(frames.take(rows), size, wide)
        nominal += early
        fast += total - early
    slow = np.flatnonzero(~frames.brs)
    nominal[slow] += fast[slow]
    fast[slow] = 0
    return WireBits(nominal, fast)


def _fd_stuff_bits(frames: CanBatch, dlc: int, extended: bool) -> tuple[U16, U16]:
    """Count the stuff bits of FD frames of one DLC: those in front of the bit rate switch, and all dynamic ones."""
    identifier = frames.identifier.astype(np.uint64)
    fdf = np.uint64(1 << 7)
    if extended:
        head = ((identifier >> np.uint64(18)) << np.uint64(29)) | np.uint64(0b11 << 27)
        head |= (identifier & np.uint64(0x3FFFF)) << np.uint64(9)
        head_bits = FD_ARBITRATION_BITS_EXTENDED + FD_CONTROL_BITS
    else:
        head = identifier << np.uint64(10)
        head_bits = FD_ARBITRATION_BITS + FD_CONTROL_BITS
    head |= fdf | (frames.brs.astype(np.uint64) << np.uint64(5)) | (frames.esi.astype(np.uint64) << np.uint64(4))
    head |= np.uint64(dlc) | np.uint64((_PAD << head_bits) % (1 << 64))
    size = FD_LENGTHS[dlc]
    bits = np.zeros((len(frames), -(-(head_bits + 8 * size) // 16) * 2), np.uint8)
    head_bytes = bits.shape[1] - size
    bits[:, :head_bytes] = head.astype(">u8").view(np.uint8).reshape(-1, 8)[:, 8 - head_bytes :]
    told = np.arange(size) < frames.length[:, np.newaxis]  # a length between those of the DLC is filled up
    places = np.where(told, frames.at[:, np.newaxis] + np.arange(size), 0)
    bits[:, head_bytes:] = np.where(told, frames.data[places], 0)
    words = bits.view(">u2").astype(np.int64)
    total, state = _stuff_bits(list(words.T))
    stuffed_last: Bool = (state >> 2) != (bits[:, -1] & 1)
    before_switch = head >> np.uint64(FD_CONTROL_BITS + 1)
    early, _ = _stuff_bits(_words(before_switch, before_switch, 3))
    return early, total - stuffed_last
