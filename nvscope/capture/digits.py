"""Decimal and hexadecimal digits of many texts at once: eight characters are one 64-bit word.

Every function takes a column of words whose lowest byte is the first character (little-endian), and returns what the
digits say and a column that is 0 exactly where all eight characters were digits.
"""

from __future__ import annotations

import numpy as np

from dissectors.batch import U64

ZEROS = 0x3030_3030_3030_3030
"""Eight characters '0'."""

_ONES = np.uint64(0x0101_0101_0101_0101)
_LOW = np.uint64(0x0F0F_0F0F_0F0F_0F0F)
_HIGH = np.uint64(0xF0F0_F0F0_F0F0_F0F0)
_SIXES = np.uint64(0x0606_0606_0606_0606)
_FIFTEENS = np.uint64(0x0F0F_0F0F_0F0F_0F0F)
_ZEROS = np.uint64(ZEROS)
_CARRY = np.uint64(0x1010_1010_1010_1010)


def _u(number: int) -> np.uint64:
    return np.uint64(number)


def last_characters(words: U64, count: int) -> U64:
    """Return words of '0's that end with the first ``count`` characters of ``words``, 1 to 8."""
    if count == 8:
        return words
    moved: U64 = words << _u(8 * (8 - count))
    moved |= _u(ZEROS >> 8 * count)
    return moved


def decimal(words: U64) -> tuple[U64, U64]:
    """Return the numbers that eight decimal digits make."""
    value = words ^ _ZEROS
    wrong = value + _SIXES
    wrong |= value
    wrong &= _HIGH
    # Two digits to a byte, then four and four bytes at once by multiplication.
    value = value * _u(10) + (value >> _u(8))
    tens = (value & _u(0x0000_00FF_0000_00FF)) * _u(0x000F_4240_0000_0064)
    units = ((value >> _u(16)) & _u(0x0000_00FF_0000_00FF)) * _u(0x0000_2710_0000_0001)
    number: U64 = (tens + units) >> _u(32)
    return number, wrong


def hexadecimal(words: U64) -> tuple[U64, U64]:
    """Return the four bytes that eight hexadecimal digits of either case make, the first as the lowest byte."""
    letter = (words >> _u(6)) & _ONES
    low = words & _LOW
    # A letter is 4x or 6x, x from 1 to 6; a digit 3x, x up to 9.
    wrong = (words & ~(letter << _u(5))) ^ (_ZEROS + (letter << _u(4)))
    wrong &= _HIGH
    nibble = low + letter * _u(9)
    wrong |= (low + _SIXES + letter * _u(3)) & _CARRY
    wrong |= ~(low + _FIFTEENS) & (letter << _u(4))
    value = ((nibble << _u(4)) | (nibble >> _u(8))) & _u(0x00FF_00FF_00FF_00FF)
    value = (value | (value >> _u(8))) & _u(0x0000_FFFF_0000_FFFF)
    value = (value | (value >> _u(16))) & _u(0x0000_0000_FFFF_FFFF)
    return value, wrong
