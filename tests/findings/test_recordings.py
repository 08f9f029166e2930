"""Recordings given together: what was said of none of them is not said of all, and what is said of one stays said."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.batch import PacketBatch
from nvscope.definition.pdos import Pdos
from nvscope.engine.reading import Reading
from nvscope.engine.run import run
from nvscope.findings.judge import judge
from nvscope.tracker.parted import PartedState
from nvscope.tracker.state import TrackerState
from tests.engine.traffic import CAN_DEFINITION, CHANNELS, can_batches
from tests.laws import examples
from tests.oracle.traffic import generate
from tests.oracle.wire import SECOND, A, B, C, Wire
from tests.packets import Batches, batch_of, cut, document_of, recorded, tracked
from tests.records import replace

DAY = 86_400 * SECOND
Finding = dict[str, Any]


def found(*recordings: Wire | Sequence[PacketBatch]) -> dict[str, Finding]:
    """Return the findings on recordings given together, by code."""
    batches = [[batch_of(one.frames)] if isinstance(one, Wire) else one for one in recordings]
    return {finding["code"]: finding for finding in document_of(tracked(recorded(*batches)))["findings"]}


def sent(day: int, *counters: int, source: str = A, list_id: int = 1, wire: Wire | None = None) -> Wire:
    """Return telegrams of one stream, sent each 100 ms from the beginning of a day on."""
    wire = wire or Wire()
    for number, counter in enumerate(counters):
        wire.data(day * DAY + number * SECOND // 10, counter, source=source, list_id=list_id)
    return wire


def test_one_telegram_a_recording_says_nothing_of_how_a_sender_counts() -> None:
    assert "NV205" not in found(*(sent(day, 500 * day) for day in range(10)))
    assert "NV205" not in found(*(sent(day, 5) for day in range(10)))


def test_steps_of_several_recordings_show_together_that_a_sender_does_not_count() -> None:
    """Each recording has one step less than telegrams, and eight telegrams of one have seven."""
    assert "NV205" in found(sent(0, *[5] * 8))
    assert "NV205" not in found(sent(0, *[5] * 4), sent(1, *[5] * 4))
    told = found(sent(0, *[5] * 4), sent(1, *[9] * 5))["NV205"]
    assert told["message"].startswith("Within each recording, all of 9 telegrams carry the same Counter: ")


def test_a_sender_with_another_address_in_the_next_recording_is_no_second_one() -> None:
    first, second = sent(0, 1, 2, 3), sent(1, 1, 2, 3, source=B)
    assert "NV401" not in found(first, second)
    (entry,) = document_of(tracked(recorded([batch_of(first.frames)], [batch_of(second.frames)])))["lists"]
    assert entry["senders"] == [A, B]  # both have sent it, if not together


def test_senders_of_one_recording_are_several_whatever_the_others_have() -> None:
    both = sent(1, 1, 2, 3, wire=sent(1, 1, 2, 3, source=B))
    told = found(sent(0, 1, 2), both, sent(2, 1, 2, source=C))["NV401"]
    assert told["message"] == f"2 nodes send this list: {A}, {B}."
    assert (told["count"], told["frames"], told["first_ns"]) == (1, [6], str(DAY))


def test_senders_that_are_several_in_each_recording_are_told_of_each() -> None:
    both = [sent(day, 1, 2, 3, wire=sent(day, 1, 2, 3, source=B)) for day in range(3)]
    told = found(*both)["NV401"]
    assert told["message"] == f"2 nodes send this list: {A}, {B}."
    assert (told["count"], told["frames"]) == (3, [4, 10, 16])
    assert (told["first_ns"], told["last_ns"]) == ("0", str(2 * DAY))


def test_a_telegram_that_nobody_could_read_shows_a_second_sender_too() -> None:
    broken = sent(1, 1, 2).data(DAY + SECOND, 3, source=B, length=999)
    assert found(sent(0, 1, 2, source=B), broken)["NV401"]["frames"] == [5]


def mirrored(day: int) -> Wire:
    wire = sent(day, *range(1, 41))
    copies = [frame._replace(ts_ns=frame.ts_ns + 1_000) for frame in wire.frames]
    wire.frames = sorted([*wire.frames, *copies], key=lambda frame: frame.ts_ns)
    return wire


@pytest.mark.parametrize("days", [(0, 1, 2, 3), (1, 2, 0, 3), (2, 3, 1, 0)])
def test_one_recording_that_is_mirrored_twice_is_told_among_others(days: Sequence[int]) -> None:
    day = days[0]
    wires = sorted([mirrored(day), *(sent(other, *range(1, 101)) for other in days[1:])], key=lambda wire: wire.frames)
    told = found(*wires)["NV905"]
    assert told["message"].startswith("40 of 80 telegrams equal the one before, byte for byte, in 1 of 4 recordings: ")
    assert (told["first_ns"], told["last_ns"]) == (str(day * DAY), str(day * DAY + 39 * SECOND // 10 + 1_000))
    assert "in 1 of" not in found(mirrored(0))["NV905"]["message"]


def test_whether_a_sender_counts_is_asked_of_each_recording() -> None:
    """One that sends the same telegram again and again is not mirrored, though it counted the day before."""
    resting = Wire()
    for number in range(40):
        resting.data(DAY + number * SECOND // 10, 7, data=bytes(4))
    assert "NV905" not in found(resting)
    assert "NV905" not in found(sent(0, 1, 2, 3), resting)


def test_a_public_address_is_outside_of_those_of_its_own_recording() -> None:
    """In recordings given together, the others may be those of another plant."""
    outside = sent(0, 1, 2, wire=sent(0, 1, 2, wire=sent(0, 1, 2, source="8.8.4.4"), source=B))
    assert "NV965" in found(outside)
    assert "NV965" not in found(sent(0, 1, 2, wire=sent(0, 1, 2, source="8.8.4.4")), sent(1, 1, 2, source=B))


def places(batches: Sequence[PacketBatch]) -> set[tuple[Any, ...]]:
    """Return what is found, and where."""
    report = document_of(tracked(batches))
    return {
        (one["code"], *(one[name] for name in ("list", "node", "subindex", "channel") if name in one))
        for one in report["findings"]
    }  # fmt: skip


POOLED = ("NV2", "NV5")
"""What hangs on how a sender counts, and how often it sends: many telegrams show that, of whichever recordings."""


def traffic(seed: int, day: int) -> list[PacketBatch]:
    """Return telegrams, or every third time CAN frames, thousands of days apart."""
    on_can = seed % 3 == 0
    batches = can_batches(random.Random(seed), 3) if on_can else cut(batch_of(generate(seed, frames=120)), 50)
    return [replace(part, ts_ns=part.ts_ns + day * 1000 * DAY) for part in batches]


@examples(80)
@given(st.lists(st.integers(0, 10_000), min_size=2, max_size=4))
def test_what_is_found_in_recordings_given_together_is_found_in_one_of_them(seeds: Sequence[int]) -> None:
    batches = [traffic(seed, day) for day, seed in enumerate(seeds)]
    alone = set().union(*map(places, batches))
    assert {place for place in places(recorded(*batches)) - alone if not place[0].startswith(POOLED)} == set()


@examples(80)
@given(st.lists(st.integers(0, 10_000), min_size=2, max_size=4), st.integers(2, 5), st.sampled_from([3, 200_000]))
def test_recordings_folded_in_parts_give_the_same(seeds: Sequence[int], parts: int, most: int) -> None:
    batches = recorded(*(traffic(seed, day) for day, seed in enumerate(seeds)))
    whole, parted = TrackerState(), PartedState(parts)
    reading = Reading(max_streams=most, pdos=Pdos(CAN_DEFINITION).rules())
    for _ in run(Batches(batches, CHANNELS), reading, [whole, parted]):
        pass
    joined = parted.join()
    assert judge(joined) == judge(whole)
    assert document_of(joined) == document_of(whole)
