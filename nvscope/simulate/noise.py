"""Chance that is the same on every machine, with every numpy, and for every size of batch.

Nothing is drawn from a stream of numbers: the *n*-th number of a purpose is a function of the seed, the purpose and
*n* (SplitMix64: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, OOPSLA 2014). Only integers are
used, so that no rounding of a platform's mathematics comes in.
"""

from __future__ import annotations

import hashlib

import numpy as np

from dissectors.batch import I64, U64, Bool

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_A = np.uint64(0xBF58476D1CE4E5B9)
_MIX_B = np.uint64(0x94D049BB133111EB)


def noise_key(seed: int, *purpose: str | int) -> int:
    """Return the 64-bit key of one purpose, such as ``noise_key(7, "jitter", 3)``."""
    text = "\x1f".join(str(part) for part in (seed, *purpose))
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")


def noise(key: int, numbers: I64) -> U64:
    """Return 64 random bits for each number. Shapes (n,)."""
    mixed = (numbers.astype(np.uint64) + np.uint64(1)) * _GOLDEN + np.uint64(key)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * _MIX_A
    mixed = (mixed ^ (mixed >> np.uint64(27))) * _MIX_B
    return mixed ^ (mixed >> np.uint64(31))


def uniform(key: int, numbers: I64, end: int) -> I64:
    """Return a random integer from 0 to ``end - 1`` for each number. Shapes (n,)."""
    return (noise(key, numbers) % np.uint64(end)).astype(np.int64)


def chance(key: int, numbers: I64, probability: float) -> Bool:
    """Return where something of the given probability (0 to 1, in steps of 2^-32) happens. Shapes (n,)."""
    return (noise(key, numbers) >> np.uint64(32)) < np.uint64(round(probability * (1 << 32)))
