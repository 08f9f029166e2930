"""What the bytes of telegrams say about where a field lies and which type it has.

Nothing is marked on the wire: neither types nor ends of fields, and there is no alignment. Each place that could be a
field therefore gets a price in bits: how many it takes to tell its values if it is of a type (a REAL has a likely
exponent, an INT is near 0), how many to tell each value after the one before (a counter takes hardly any), and how rare
the type is in lists. Cheap is plausible. Prices of neighbours add up, so that whole layouts can be compared.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from dissectors.batch import I64, U8, Bool

F64 = npt.NDArray[np.float64]

_RARE = {
    "BOOL": 2.0, "BYTE": 4.5, "SINT": 7.0, "UINT": 2.5, "INT": 2.3, "UDINT": 3.0, "DINT": 2.9, "ULINT": 7.0,
    "LINT": 7.0, "REAL": 2.3, "LREAL": 4.5, "TIME": 1.5, "DT": 5.0, "LDT": 6.0, "STRING": 4.0, "UNKNOWN": 20.0,
}  # fmt: skip
"""How rare a type is in lists: minus the logarithm, to base 2, of about its share."""

_INTEGERS = {1: ("BYTE", "SINT"), 2: ("UINT", "INT"), 4: ("UDINT", "DINT"), 8: ("ULINT", "LINT")}
_USUAL_LENGTHS = {80: 1.0, 255: 3.0} | dict.fromkeys((10, 12, 15, 16, 20, 25, 30, 31, 32, 40, 50, 60, 63, 64, 100), 3.0)
_RARE_LENGTH = 6.0
_CHARACTER, _LEFTOVER_ZERO, _LEFTOVER_TEXT, _LEFTOVER_OTHER = 4.0, 0.15, 3.5, 24.0
_MOST_STRING_PRICE_AHEAD = 60.0
_SHORT_TEXT = 6.0
_IMPLAUSIBLE = 40.0
_ZERO_REAL = 2.0
_STANDING_DATE = {"DT": 40.0, "LDT": 72.0}
"""What a date costs that does not move: a third of all numbers of 32 bits are dates of these years."""

_WHOLE_NUMBER = 1.5
"""What any whole number costs, so that 0 and 1 are likelier as a BOOL."""

_BEHIND_CHANGES = 3.0
"""What a field costs whose first byte stands still behind one of many values: rather, that is a number's high byte."""

_MANY_VALUES = 8
_LENGTH_SHARE = 0.6
_FULL_RANGE = 3.0
"""What a number over the whole range of its type costs beyond its bits: real numbers rarely use all of it."""

_FIRST_DAY_S, _LAST_DAY_S = 946_684_800, 2_208_988_800  # from 2000 to 2040
_S_NS = 1_000_000_000


class Candidate(Struct, frozen=True):
    """A possible field: ``price`` in bits as the type that fits best; ``prices`` those of all types that could be."""

    offset: int
    size_bytes: int
    prices: tuple[tuple[str, float], ...]

    @property
    def price(self) -> float:
        return self.prices[0][1]

    @property
    def type(self) -> str:
        return self.prices[0][0]

    @property
    def end(self) -> int:
        return self.offset + self.size_bytes


def candidates(data: U8, first: U8, first_ns: I64, most_bytes: int) -> list[Candidate]:
    """Return all fields of up to ``most_bytes`` that telegrams could have, by offset.

    ``data`` are telegrams as (n, bytes), of which the ``first`` follow each other in the stream, at ``first_ns``.
    """
    found: list[Candidate] = []
    behind = _behind_changes(data)
    for size in _INTEGERS:
        if data.shape[1] < size:
            break
        prices = _scalar_prices(_words(data, size), _words(first, size), first_ns, size)
        names = list(prices)
        table = np.stack([prices[name] for name in names])
        order = np.argsort(table, axis=0, kind="stable")
        for offset in range(table.shape[1]):
            extra = float(behind[offset])
            told = tuple(
                (names[row], float(table[row, offset]) + extra)
                for row in order[:, offset]
                if np.isfinite(table[row, offset])
            )
            found.append(Candidate(offset, size, told))
    found += _strings(data, first, most_bytes)
    found.sort(key=lambda entry: (entry.offset, entry.size_bytes))
    return found


def opaque_candidates(size_bytes: int, items: int) -> list[Candidate]:
    """Return fields of any size of which nothing is known, for telegrams that nothing else explains."""
    return [
        Candidate(offset, size, (("UNKNOWN", _RARE["UNKNOWN"] + 18.0 * size),))
        for offset in range(size_bytes)
        for size in range(3 if items > 1 else size_bytes, size_bytes - offset + 1)
        if size >= 3 and size not in (4, 8)
    ]


def _behind_changes(data: U8) -> F64:
    """Return the price of a field that begins at each byte, for standing still behind a byte that does not."""
    ordered = np.sort(data, axis=0)
    values = (ordered[1:] != ordered[:-1]).sum(axis=0) + 1
    price = np.zeros(data.shape[1])
    price[1:] = np.where((values[1:] == 1) & (values[:-1] > _MANY_VALUES), _BEHIND_CHANGES, 0.0)
    return price


def _words(data: U8, size: int) -> npt.NDArray[np.unsignedinteger]:
    """Return the words at every offset, shape (n, offsets)."""
    windows = np.lib.stride_tricks.sliding_window_view(data, size, axis=1)
    return np.ascontiguousarray(windows).view(f"<u{size}")[:, :, 0]


def _bits(magnitude: F64) -> F64:
    """Return how many bits it takes to tell whole numbers of which small ones are likelier."""
    length = np.log2(1 + magnitude)
    told: F64 = length + _LENGTH_SHARE * np.log2(1 + length)
    return told


def _scalar_prices(
    words: npt.NDArray[np.unsignedinteger], first: npt.NDArray[np.unsignedinteger], first_ns: I64, size: int
) -> dict[str, F64]:
    unsigned, signed = _INTEGERS[size]
    most = 8.0 * size + _FULL_RANGE
    steps = first[1:] - first[:-1]  # wraps around, as counters do
    step = steps.view(f"<i{size}").astype(np.float64)
    usual = np.median(step, axis=0) if len(step) else np.zeros(words.shape[1])
    walk = _mean(np.minimum(_bits(np.abs(step)) + (step != 0), most))
    walk = np.minimum(walk, _mean(np.minimum(_bits(np.abs(step - usual)) + (step != usual), most)) + 0.5)
    number = words.astype(np.float64)
    walk = walk + _WHOLE_NUMBER
    prices = {unsigned: _mean(np.minimum(_bits(number), most)) + walk + _RARE[unsigned]}
    magnitude = np.abs(words.view(f"<i{size}").astype(np.float64))
    prices[signed] = _mean(np.minimum(_bits(magnitude) + 1, most)) + walk + _RARE[signed]
    if size == 1:
        binary = (words <= 1).all(axis=0)
        share, flips = number.mean(axis=0), _mean((step != 0).astype(np.float64))
        told = _entropy(np.clip(share, 0, 1)) + _entropy(np.clip(flips, 0, 1)) + 0.3
        prices["BOOL"] = np.where(binary, told + _RARE["BOOL"], np.inf)
    elif size == 4:
        prices["REAL"] = _real_price(words, first, 8, 23) + _RARE["REAL"]
        prices |= _clock_prices(words, step, first_ns, "DT", _S_NS, 1)
        since = _running(step, first_ns, 1_000_000)
        prices["TIME"] = np.where(since, prices[unsigned] - _RARE[unsigned] + _RARE["TIME"] - 2.0, np.inf)
    elif size == 8:
        prices["LREAL"] = _real_price(words, first, 11, 52) + _RARE["LREAL"]
        prices |= _clock_prices(words, step, first_ns, "LDT", 1, _S_NS)
    return prices


def _mean(table: F64) -> F64:
    mean: F64 = table.mean(axis=0) if len(table) else np.zeros(table.shape[1])
    return mean


def _entropy(share: F64) -> F64:
    """Return the bits of an event that has a share."""
    inner = np.clip(share, 1e-9, 1 - 1e-9)
    told: F64 = -(inner * np.log2(inner) + (1 - inner) * np.log2(1 - inner))
    return told


def _real_price(
    words: npt.NDArray[np.unsignedinteger], first: npt.NDArray[np.unsignedinteger], exponent_bits: int,
    mantissa_bits: int,
) -> F64:  # fmt: skip
    """Return the price of floating-point numbers of some thousandths to some millions."""
    one = np.array(1, words.dtype)
    exponent_mask = (1 << exponent_bits) - 1
    exponent = (words >> np.array(mantissa_bits, words.dtype)) & np.array(exponent_mask, words.dtype)
    mantissa = words & np.array((1 << mantissa_bits) - 1, words.dtype)
    usual = (1 << (exponent_bits - 1)) + 2
    away = np.abs(exponent.astype(np.float64) - usual)
    lowest = mantissa & (~mantissa + one)
    told_bits = np.where(mantissa > 0, mantissa_bits - np.log2(np.maximum(lowest, one).astype(np.float64)), 0)
    price = 0.7 + 1 + 0.8 * np.log2(1 + away) + np.maximum(away - 17, 0) + told_bits
    price = np.where((exponent == exponent_mask) | ((exponent == 0) & (mantissa > 0)), np.inf, price)
    price = np.where(words == 0, _ZERO_REAL, np.minimum(price, _IMPLAUSIBLE + mantissa_bits))
    # Ordered as their magnitudes are, numbers near each other are whole numbers near each other.
    most = exponent_bits + mantissa_bits + 1.0
    sign_bit = np.array(1 << (exponent_bits + mantissa_bits), first.dtype)
    magnitude = (first & ~sign_bit).astype(np.float64)
    ordered = np.where(first & sign_bit, -magnitude, magnitude)
    # Numbers such as 12.5 use the upper bits only: the lower ones say nothing about how far they move.
    used = np.bitwise_or.reduce(first, axis=0)
    ordered /= np.maximum(used & (~used + one), one).astype(np.float64)
    walk = _mean(np.minimum(_bits(np.abs(np.diff(ordered, axis=0))), most))
    return _mean(price) + walk


def _running(step: F64, first_ns: I64, unit_ns: int) -> Bool:
    """Tell where numbers go up with the time, in some unit."""
    if len(step) < 4:
        return np.zeros(step.shape[1], np.bool_)
    expected = (np.diff(first_ns) / unit_ns)[:, np.newaxis]
    whole = max((int(first_ns[-1]) - int(first_ns[0])) / unit_ns, 1.0)
    near = np.abs(step - expected) <= np.maximum(np.abs(expected) * 0.25, 2)
    moved = step.sum(axis=0)
    running: Bool = (near.mean(axis=0) > 0.8) & (np.abs(moved - whole) <= 0.1 * whole + 2) & (moved >= 8)
    return running


def _clock_prices(
    words: npt.NDArray[np.unsignedinteger], step: F64, first_ns: I64, name: str, unit_ns: int, per_s: int
) -> dict[str, F64]:
    """Return the price of dates with time: of these years, and running, or standing still."""
    low, high = _FIRST_DAY_S * per_s, _LAST_DAY_S * per_s
    plausible = ((words >= low) & (words < high)).all(axis=0)
    standing = (step == 0).all(axis=0)
    if len(step) >= 4:
        whole = (int(first_ns[-1]) - int(first_ns[0])) / unit_ns
        running = np.abs(step.sum(axis=0) - whole) <= 0.1 * abs(whole) + 1.5
        running &= (step >= 0).all(axis=0) & ~standing
    else:
        running = np.zeros(words.shape[1], np.bool_)
    price = np.where(running, 6.0, _STANDING_DATE[name])
    return {name: np.where(plausible & (running | standing), price + _RARE[name], np.inf)}


def _strings(data: U8, first: U8, most_bytes: int) -> list[Candidate]:
    """Return the fields that could be STRING(n): text with a NUL behind it, or nothing at all."""
    count, width = data.shape
    zero = data == 0
    places = np.arange(width)
    end = np.where(zero, places, width)
    end = np.minimum.accumulate(end[:, ::-1], axis=1)[:, ::-1]  # of each byte, the first NUL from there on
    text = ((data >= 0x20) & (data < 0x7F)) | (data >= 0xA0)
    plain = (data >= 0x20) & (data < 0x7F)
    odd = _sums(~text)
    plain_before = _sums(plain)
    behind = np.where(zero, _LEFTOVER_ZERO, np.where(plain, _LEFTOVER_TEXT, _LEFTOVER_OTHER))
    leftovers = _sums(behind)
    changed = _sums(first[1:] != first[:-1]) if len(first) > 1 else np.zeros((1, width + 1))
    changes = changed.mean(axis=0)
    leftovers_to = np.ascontiguousarray(leftovers.T)
    leftover: F64 = np.asarray(leftovers.mean(axis=0))
    rows = np.arange(count)
    held: Bool = np.asarray(data.any(axis=0))
    set_before = np.append(0, np.cumsum(held))
    # Behind each byte, whether a STRING may well end there: what follows is no rest of it.
    edge = np.append(held, True)
    usual = np.full(width + 1, np.nan)
    for characters, told in _USUAL_LENGTHS.items():
        usual[characters + 1 : characters + 2] = told
    found: list[Candidate] = []
    for offset in range(width - 1):
        stop = end[:, offset]
        longest = int(stop.max())
        if longest >= width or (odd[rows, stop] - odd[rows, offset]).any():
            continue
        length = stop - offset
        readable = float((plain_before[rows, stop] - plain_before[rows, offset]).sum()) >= 0.8 * float(length.sum())
        if not readable or (longest > offset and longest - offset < 2):
            continue
        price = _CHARACTER * float(length.mean()) + (_SHORT_TEXT if longest - offset < 3 else 0.0)
        empty = longest == offset
        least = max(longest - offset + 1, 3)
        sizes = np.arange(least, min(width - offset, most_bytes) + 1)
        ends = offset + sizes
        ahead = leftovers[rows, stop + 1]
        wanted = leftover[ends] - float(ahead.mean()) <= _MOST_STRING_PRICE_AHEAD
        if empty:
            starts = offset == 0 or bool(held[offset - 1])
            wanted &= (set_before[ends] == set_before[offset]) & (starts | edge[ends] | np.isfinite(usual[sizes]))
        sizes, ends = sizes[wanted], ends[wanted]
        rest = (leftovers_to[ends] - ahead).mean(axis=1)
        walk = _CHARACTER * (changes[ends] - changes[offset])
        known = np.where(np.isnan(usual[sizes]), _RARE_LENGTH, usual[sizes])
        prices = price + rest + walk + known + _RARE["STRING"]
        found += [
            Candidate(offset, size, (("STRING", told),))
            for size, told in zip(sizes.tolist(), prices.tolist(), strict=True)
        ]
    return found


def _sums(table: npt.NDArray[np.generic]) -> F64:
    """Return the sums of the columns before each place, shape (n, columns + 1)."""
    sums = np.zeros((len(table), table.shape[1] + 1))
    np.cumsum(table, axis=1, out=sums[:, 1:])
    return sums
