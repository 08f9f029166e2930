"""Lists as plants have them, with values that move as values do: what layouts are inferred from, and the truth."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from dissectors.batch import U8
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import String, Type

Values = Callable[[random.Random, int], Iterator[float | int | str]]


def _standing(choices: Sequence[float | int | str]) -> Values:
    def values(choice: random.Random, count: int) -> Iterator[float | int | str]:
        yield from [choice.choice(choices)] * count

    return values


def _flag(choice: random.Random, count: int) -> Iterator[int]:
    now, share = choice.randrange(2), choice.choice([0.01, 0.1, 0.5])
    for _ in range(count):
        now ^= choice.random() < share
        yield now


def _counter(choice: random.Random, count: int) -> Iterator[int]:
    start, step = choice.choice([0, 1, 500, 70_000]), choice.choice([1, 1, 1, 10, 50])
    yield from (start + step * number for number in range(count))


def _smooth(low: float, high: float, noise: float = 0.002) -> Values:
    def values(choice: random.Random, count: int) -> Iterator[float]:
        period, phase, span = choice.uniform(30, 400), choice.uniform(0, 6), high - low
        for number in range(count):
            wave = (math.sin(number * 2 * math.pi / period + phase) + 1) / 2
            yield low + span * min(1, max(0, wave + choice.gauss(0, noise)))

    return values


def _setpoint(choices: Sequence[float]) -> Values:
    def values(choice: random.Random, count: int) -> Iterator[float]:
        now = choice.choice(choices)
        for _ in range(count):
            now = choice.choice(choices) if choice.random() < 0.02 else now
            yield now

    return values


def _state(choice: random.Random, count: int) -> Iterator[int]:
    now = 0
    for _ in range(count):
        now = choice.randrange(8) if choice.random() < 0.05 else now
        yield now


def _word(choice: random.Random, count: int) -> Iterator[int]:
    now = choice.randrange(1 << 16)
    for _ in range(count):
        now ^= (1 << choice.randrange(16)) if choice.random() < 0.2 else 0
        yield now


def _noise(low: int, high: int) -> Values:
    def values(choice: random.Random, count: int) -> Iterator[int]:
        yield from (choice.randint(low, high) for _ in range(count))

    return values


def _clock(choice: random.Random, count: int) -> Iterator[int]:
    start, cycle = choice.randrange(10_000_000), 50
    yield from (start + cycle * number for number in range(count))


def _order(choice: random.Random, count: int) -> Iterator[str]:
    number = choice.randrange(10_000)
    for _ in range(count):
        number += choice.random() < 0.05
        yield f"order {number}"


KINDS: list[tuple[float, str, Values]] = [
    (20, "BOOL", _flag),
    (4, "BOOL", _standing([0, 1])),
    (3, "BYTE", _state),
    (2, "BYTE", _smooth(0, 200)),
    (6, "INT", _state),
    (5, "INT", _smooth(-300, 300)),
    (4, "INT", _setpoint([0, 100, 250, 1500, -20])),
    (3, "INT", _smooth(0, 27_648)),
    (3, "WORD", _word),
    (3, "UINT", _counter),
    (6, "UDINT", _counter),
    (4, "DINT", _smooth(-20_000, 150_000)),
    (2, "DINT", _setpoint([0, 1000, 25_000])),
    (2, "DINT", _noise(0, 1_000_000)),
    (10, "REAL", _smooth(10, 90)),
    (5, "REAL", _smooth(-1, 1)),
    (4, "REAL", _setpoint([0.0, 12.5, 100.0, 0.1, 37.2])),
    (2, "REAL", _standing([0.0, 1.0, 50.0])),
    (3, "LREAL", _smooth(0, 1000)),
    (3, "TIME", _clock),
    (2, "TIME", _standing([0, 500, 10_000])),
    (2, "STRING", _order),
    (2, "STRING", _standing(["Anlage 3", "Rezept Süd", "A-1047/b", ""])),
]
"""How common a type with such values is among the fields, its name, and what the values do."""


def realistic_list(seed: int, most_bytes: int = 256) -> tuple[list[Type], list[Values]]:
    """Return the types of a packed list of one telegram, and what the values of each do."""
    choice = random.Random(seed)
    types: list[Type] = []
    movements: list[Values] = []
    room = choice.choice([30, 60, 120, most_bytes])
    while True:
        _, name, values = choice.choices(KINDS, [share for share, _, _ in KINDS])[0]
        kind: Type = String(choice.choice([80, 20, 30, 40, 32])) if name == "STRING" else SCALARS[name]
        repeat = choice.choice([1, 1, 1, 2, 4])
        if kind.size_bytes * repeat > room:
            return (types, movements) if types else realistic_list(seed + 1_000_000, most_bytes)
        room -= kind.size_bytes * repeat
        types += [kind] * repeat
        movements += [values] * repeat


def telegrams_of(types: Sequence[Type], movements: Sequence[Values], count: int, seed: int) -> U8:
    """Return the data of telegrams, shape (count, bytes)."""
    choice = random.Random(seed)
    columns = []
    for kind, values in zip(types, movements, strict=True):
        raws = [_raw(kind, value) for value in values(choice, count)]
        columns.append(np.frombuffer(b"".join(raws), np.uint8).reshape(count, -1))
    return np.concatenate(columns, axis=1)


def _raw(kind: Type, value: float | int | str) -> bytes:
    if isinstance(kind, String):
        return str(value).encode("iso-8859-1")[: kind.length].ljust(kind.size_bytes, b"\0")
    name = kind.name  # type: ignore[union-attr]  # scalars and strings only
    if name in ("REAL", "LREAL"):
        return struct.pack("<f" if name == "REAL" else "<d", value)
    size = kind.size_bytes
    return (int(value) & ((1 << 8 * size) - 1)).to_bytes(size, "little")
