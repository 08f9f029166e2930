"""Batches for the laws of observers: telegrams, CAN frames, or both, from a seed; and definitions of their lists."""

from __future__ import annotations

import random
from collections.abc import Sequence
from itertools import pairwise

from dissectors.batch import PacketBatch
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition
from nvscope.definition.pdos import Pdos
from nvscope.engine.reading import Reading
from nvscope.view.display_filter import DisplayFilter, PacketChoice
from nvscope.view.fields.vocabulary import vocabulary
from tests.definition.lists import INT, LREAL, UDINT, list_of
from tests.oracle.builders import LINKS
from tests.oracle.traffic import generate
from tests.packets import batch_of, cut, recorded
from tests.records import replace
from tests.tracker.can.test_state import batch

DEFINITION = Definition(
    (*(list_of([INT, UDINT], list_id=number) for number in (1, 2, 3, 7)), list_of([INT], list_id=5))
)  # fmt: skip
LAYOUTS = Layouts(DEFINITION)
CAN_DEFINITION = Definition((replace(list_of([LREAL, INT, INT], list_id=0x181), protocol="CAN"),))
CAN_LAYOUTS = Layouts(CAN_DEFINITION)
BOTH = Definition((*DEFINITION.lists, *CAN_DEFINITION.lists))

CHANNELS = [f"can{number}" for number in range(5)]
CAN_FRAMES = (
    *((word, size) for word in (0x181, 0x182, 0x8000_0181) for size in (8, 8, 4)),
    *((word, 8) for word in (0x81, 0x2000_0040, 0x2000_0100, 0x2000_0204)),
    (0, 2), (0x701, 1), (0x4000_0181, 0), (0x7FF, 8), (0x7FF, 12),
)  # fmt: skip


def reading_of(expression: str | None, definition: Definition = DEFINITION) -> Reading:
    choose = PacketChoice(DisplayFilter(expression, vocabulary(Layouts(definition)))) if expression else None
    return Reading(pdos=Pdos(definition).rules(), choose=choose)


def batches_of(seed: int, chance: random.Random) -> list[PacketBatch]:
    whole = batch_of(generate(seed, frames=chance.choice([60, 250]), link=chance.choice([1, *LINKS, None])))
    cuts = sorted(chance.sample(range(len(whole) + 1), min(len(whole), chance.choice([0, 2, 9]))))
    return [whole[start:stop] for start, stop in zip([0, *cuts], [*cuts, len(whole)], strict=True) if stop > start]


def can_batches(chance: random.Random, channels: int) -> list[PacketBatch]:
    """Return frames of lists, heartbeats, commands, emergencies, requests and errors on several channels, cut."""
    time_ns, frames = 1_700_000_000_000_000_000, []
    for _ in range(chance.choice([30, 400])):
        # Squares of intervals of some hours and more are kept apart.
        time_ns += chance.choices([220_000, 1_000_000, 50_000_000, 10**14], [10, 10, 10, 1])[0]
        word, size = chance.choice(CAN_FRAMES)
        frames.append((time_ns, chance.randrange(channels), word, chance.randbytes(size)))
    return cut(batch(frames), chance.choice([7, 64, 400]))


def traffic(seed: int) -> list[PacketBatch]:
    """Return batches on UDP, on CAN, or on both, in one order of time or not."""
    chance = random.Random(seed)
    kind = chance.choice(["udp", "can", "both"])
    batches = [] if kind == "can" else batches_of(seed, chance)
    if kind != "udp":
        batches += can_batches(chance, chance.choice([1, 3]))
        chance.shuffle(batches)
    return batches


def with_holes(batches: Sequence[PacketBatch], chance: random.Random) -> list[PacketBatch]:
    """Return batches with up to three times between them in which nobody listens."""
    cuts = chance.sample(range(1, len(batches)), min(chance.randrange(4), len(batches) - 1))
    return recorded(*(batches[begin:end] for begin, end in pairwise([0, *sorted(cuts), len(batches)])))


def span_ns(batches: Sequence[PacketBatch]) -> int:
    times = [int(time) for part in batches for time in part.ts_ns]
    return max(times) - times[0]


def length_of(batches: Sequence[PacketBatch], chance: random.Random) -> int:
    """Return a length of which a few windows or many fit; of odd nanoseconds, so that edges lie anywhere."""
    return max(span_ns(batches) // chance.choice([1, 3, 10, 50]), 1) + chance.choice([0, 1, 977])
