"""Bits on the wire against frames written out bit by bit, and against figures of canbusload."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import LinkType
from dissectors.can.bits import Stuffing, wire_bits
from dissectors.can.frame import FD_LENGTHS, CanBatch, dissect_can
from tests.oracle.frame import Frame
from tests.packets import batch_of

EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
BRS, ESI, FD = 1, 2, 4


def raw_frame(word: int, data: bytes = b"", *, flags: int = 0, length: int | None = None, dlc: int = 0) -> bytes:
    return struct.pack(">IBBBB", word, len(data) if length is None else length, flags, 0, dlc) + data


def frames_of(raws: Iterable[bytes]) -> CanBatch:
    return dissect_can(batch_of([Frame(0, LinkType.CAN_SOCKETCAN, raw, len(raw)) for raw in raws]))


def counts(raws: list[bytes], stuffing: Stuffing) -> list[tuple[int, int]]:
    bits = wire_bits(frames_of(raws), stuffing)
    assert (bits.nominal.dtype, bits.fast.dtype) == ("uint16", "uint16")
    return list(zip(bits.nominal.tolist(), bits.fast.tolist(), strict=True))


def number(value: int, width: int) -> list[int]:
    return [value >> position & 1 for position in range(width - 1, -1, -1)]


def crc15(bits: list[int]) -> list[int]:
    """The CRC of Bosch CAN 2.0, section 3.1.1, one bit after the other."""
    register = 0
    for bit in bits:
        feedback = bit ^ (register >> 14)
        register = (register << 1) & 0x7FFF
        if feedback:
            register ^= 0x4599
    return number(register, 15)


def stuffed(bits: list[int]) -> list[tuple[int, int | None]]:
    """Return the bits with stuff bits between them, each with its place in ``bits``, None for a stuff bit."""
    out: list[tuple[int, int | None]] = []
    run: list[int] = []
    for place, bit in enumerate(bits):
        out.append((bit, place))
        run = [*run, bit] if run and run[-1] == bit else [bit]
        if len(run) == 5:
            out.append((1 - bit, None))
            run = [1 - bit]
    return out


def classic_bits(word: int, data: bytes, dlc: int) -> int:
    """Write a classic frame out, and count."""
    rtr = [int(bool(word & REMOTE))]
    if word & EXTENDED:
        identifier = number(word & 0x1FFF_FFFF, 29)
        bits = [0, *identifier[:11], 1, 1, *identifier[11:], *rtr, 0, 0, *number(dlc, 4)]
    else:
        bits = [0, *number(word & 0x7FF, 11), *rtr, 0, 0, *number(dlc, 4)]
    for byte in b"" if word & REMOTE else data:
        bits += number(byte, 8)
    bits += crc15(bits)
    delimiter, ack, ack_delimiter, end_of_frame, interframe_space = 1, 1, 1, 7, 3
    return len(stuffed(bits)) + delimiter + ack + ack_delimiter + end_of_frame + interframe_space


def fd_bits(word: int, data: bytes, flags: int) -> tuple[int, int]:
    """Write an FD frame out, and count the bits before and after the bit rate switch."""
    dlc = next(code for code, size in enumerate(FD_LENGTHS) if size >= len(data))
    if word & EXTENDED:
        identifier = number(word & 0x1FFF_FFFF, 29)
        bits = [0, *identifier[:11], 1, 1, *identifier[11:], 0, 1, 0]
    else:
        bits = [0, *number(word & 0x7FF, 11), 0, 0, 1, 0]
    switch = len(bits)
    bits += [flags & BRS, flags >> 1 & 1, *number(dlc, 4)]
    for byte in data.ljust(FD_LENGTHS[dlc], b"\0"):
        bits += number(byte, 8)
    line = stuffed(bits)
    if line[-1][1] is None:
        line.pop()  # the fixed stuff bit that follows is also this one
    arbitration = next(place for place, (_, source) in enumerate(line) if source == switch) + 1
    crc = 17 if FD_LENGTHS[dlc] <= 16 else 21
    checked = 4 + crc
    fixed = len(range(0, checked, 4))  # one in front of the stuff count, then one after every four bits
    delimiter, ack, ack_delimiter, end_of_frame, interframe_space = 1, 1, 1, 7, 3
    fast = len(line) - arbitration + checked + fixed + delimiter
    nominal = arbitration + ack + ack_delimiter + end_of_frame + interframe_space
    return (nominal, fast) if flags & BRS else (nominal + fast, 0)


# bytes whose bits change seldom: much to stuff
lazy_bytes = st.sampled_from([0x00, 0xFF, 0x0F, 0xF0, 0x07, 0xF8, 0x1F, 0x83, 0x7C])


def payloads(size: int) -> st.SearchStrategy[bytes]:
    return st.binary(min_size=size, max_size=size) | st.lists(lazy_bytes, min_size=size, max_size=size).map(bytes)


words = st.integers(0, 0x7FF) | st.integers(0, 0x1FFF_FFFF).map(lambda n: n | EXTENDED)
words |= st.sampled_from([0, 0x7FF, 0x078, 0x787, EXTENDED, EXTENDED | 0x1FFF_FFFF, EXTENDED | 0x1F07_C1F0])
classic = st.tuples(words, st.booleans(), st.integers(0, 8).flatmap(payloads), st.integers(0, 15))


@given(st.lists(classic, max_size=12))
def test_classic_frames_bit_by_bit(drawn: list[tuple[int, bool, bytes, int]]) -> None:
    raws, expected = [], []
    for identifier, remote, data, long_dlc in drawn:
        word = identifier | REMOTE * remote
        dlc = long_dlc if len(data) == 8 and long_dlc > 8 else len(data)
        raws.append(raw_frame(word, b"" if remote else data, length=len(data), dlc=long_dlc))
        expected.append((classic_bits(word, data, dlc), 0))
    assert counts(raws, Stuffing.EXACT) == expected
    bare, worst = counts(raws, Stuffing.NONE), counts(raws, Stuffing.WORST)
    assert all(low <= exact <= high for low, exact, high in zip(bare, expected, worst, strict=True))


fd_frames = st.tuples(words, st.integers(0, 64).flatmap(payloads), st.sampled_from([FD, FD | BRS, FD | ESI, 7]))


@given(st.lists(fd_frames, max_size=6))
def test_fd_frames_bit_by_bit(drawn: list[tuple[int, bytes, int]]) -> None:
    raws = [raw_frame(word, data, flags=flags) for word, data, flags in drawn]
    exact = counts(raws, Stuffing.EXACT)
    assert exact == [fd_bits(*frame) for frame in drawn]
    for low, middle, high in zip(counts(raws, Stuffing.NONE), exact, counts(raws, Stuffing.WORST), strict=True):
        assert low[0] <= middle[0] <= high[0]
        assert sum(low) <= sum(middle) <= sum(high)


@given(st.lists(classic, max_size=6), st.lists(fd_frames, max_size=4), st.randoms(use_true_random=False))
def test_kinds_of_frames_do_not_touch_each_other(
    plain: list[tuple[int, bool, bytes, int]], fast: list[tuple[int, bytes, int]], shuffle: random.Random
) -> None:
    raws = [raw_frame(word | REMOTE * remote, b"" if remote else data) for word, remote, data, _ in plain]
    raws += [raw_frame(word, data, flags=flags) for word, data, flags in fast]
    raws += [raw_frame(ERROR | 4, bytes(8)), b"short"]
    shuffle.shuffle(raws)
    for stuffing in Stuffing:
        assert counts(raws, stuffing) == [counts([raw], stuffing)[0] for raw in raws]


def test_many_frames_at_once() -> None:
    """More frames than are counted at a time."""
    rng = random.Random(4)
    kinds = [rng.choice([rng.getrandbits(11), EXTENDED | rng.getrandbits(29)]) for _ in range(200)]
    few = [raw_frame(word, rng.randbytes(rng.randint(0, 8))) for word in kinds]
    once = counts(few, Stuffing.EXACT)
    assert counts(few * 100, Stuffing.EXACT) == once * 100


VECTORS = [
    # identifier word, data, then what canbusload 2020.11 shows with -i and with -e
    (0x00000000, "", 47, 53),
    (0x000007FF, "ffffffffffffffff", 111, 126),
    (0x00000078, "0000000000000000", 111, 127),
    (0x00000123, "0102030405060708", 111, 119),
    (0x00000181, "3c3c3c3c", 79, 80),
    (0x00000555, "5555555555555555", 111, 112),
    (0x80000000, "0000000000000000", 131, 150),
    (0x9FFFFFFF, "ffffffffffffffff", 131, 149),
    (0x98FEEFF3, "0f87c3e1f0783c1e", 131, 146),
    (0x8CF00400, "1f", 75, 81),
]


@pytest.mark.parametrize(("word", "data", "bare", "exact"), VECTORS)
def test_figures_of_canbusload(word: int, data: str, bare: int, exact: int) -> None:
    raw = raw_frame(word, bytes.fromhex(data))
    assert counts([raw], Stuffing.NONE) == [(bare, 0)]
    assert counts([raw], Stuffing.EXACT) == [(exact, 0)]


def test_worst_cases_are_those_of_the_literature() -> None:
    """55 + 10 n and 80 + 10 n bits: Davis and others (2007), and what ``canbusload`` shows."""
    for size in range(9):
        assert counts([raw_frame(0x123, bytes(size))], Stuffing.WORST) == [(55 + 10 * size, 0)]
        assert counts([raw_frame(EXTENDED | 0x123, bytes(size))], Stuffing.WORST) == [(80 + 10 * size, 0)]
        assert counts([raw_frame(0x123, bytes(size))], Stuffing.NONE) == [(47 + 8 * size, 0)]
        assert counts([raw_frame(EXTENDED | 0x123, bytes(size))], Stuffing.NONE) == [(67 + 8 * size, 0)]


def test_a_remote_frame_has_no_data_whatever_it_asks_for() -> None:
    asked = [raw_frame(REMOTE | 0x123, length=size) for size in range(9)]
    assert counts(asked, Stuffing.WORST) == [(55, 0)] * 9
    assert counts(asked, Stuffing.NONE) == [(47, 0)] * 9


def test_what_is_not_on_the_wire_or_not_known_has_no_bits() -> None:
    for stuffing in Stuffing:
        assert (
            counts([raw_frame(ERROR | 0x40, bytes(8)), b"\0" * 7, raw_frame(1, bytes(8), length=0x80)], stuffing)
            == [(0, 0)] * 3
        )


def test_data_that_was_not_captured_counts_as_the_worst() -> None:
    cut = [raw_frame(1, bytes(3), length=8), raw_frame(1, bytes(3), length=64, flags=FD | BRS)]
    assert counts(cut, Stuffing.EXACT) == counts(cut, Stuffing.WORST)


def test_impossible_lengths_count_as_the_longest_frame() -> None:
    assert counts([raw_frame(1, bytes(64))], Stuffing.NONE) == [(47 + 64, 0)]
    assert counts([raw_frame(1, bytes(70), flags=FD)], Stuffing.NONE) == counts(
        [raw_frame(1, bytes(64), flags=FD)], Stuffing.NONE
    )
