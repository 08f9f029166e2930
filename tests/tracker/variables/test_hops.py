"""Hops: the same variable in several lists, against going through the values one by one."""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence
from typing import Any

import pytest

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.pdos import Pdos
from nvscope.definition.variables import String
from nvscope.engine.reading import Reading
from nvscope.tracker.variables.hops import Hops
from nvscope.view.documents.hops import hop_rows
from tests.definition.lists import INT, LREAL, list_of, telegram
from tests.laws import crossed
from tests.oracle.frame import Frame
from tests.packets import batch_of, observed
from tests.records import replace

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000


def on_udp(*types: Any, list_id: int = 7) -> ListDefinition:
    return list_of(types, list_id=list_id)


def on_can(*types: Any, list_id: int = 0x190) -> ListDefinition:
    return replace(list_of(types, list_id=list_id), protocol="CAN")


def sent_on_udp(at_ns: int, data: bytes, items: int = 1, list_id: int = 7) -> Frame:
    return telegram(data, items, subindex=0, counter=0, ts_ns=START_NS + at_ns, list_id=list_id)


def sent_on_can(at_ns: int, data: bytes, cob_id: int = 0x190) -> Frame:
    frame = struct.pack(">IBBBB", cob_id, len(data), 0, 0, 0) + data
    return Frame(START_NS + at_ns, 227, frame, len(frame))


def compared(lists: Sequence[ListDefinition], frames: Sequence[Frame], cut: int = 10_000) -> list[dict[str, Any]]:
    definition = Definition(tuple(lists))
    frames = sorted(frames, key=lambda frame: frame.ts_ns)
    parts = [batch_of(frames[begin : begin + cut]) for begin in range(0, len(frames), cut)]
    hops = observed(Hops(Layouts(definition)), parts, Reading(pdos=Pdos(definition).rules()), ["can0"])
    return hop_rows(hops, frames[-1].ts_ns)


def test_a_gateway_that_copies_a_position_to_can_3_ms_later() -> None:
    positions = [struct.pack("<d", number * 0.5) for number in range(200)]
    frames = [sent_on_udp(number * 10 * MS, data) for number, data in enumerate(positions)]
    frames += [sent_on_can(number * 10 * MS + 3 * MS, data) for number, data in enumerate(positions)]
    (row,) = compared([on_udp(LREAL), on_can(LREAL)], frames)
    assert (row["variable"], row["from"]["list"], row["to"]["list"]) == ("v0", "udp/1202/7", "can/can0/400")
    assert (row["changes"], row["followed"]) == (199, 199)
    assert row["delay_ns"]["min"] == row["delay_ns"]["max"] == row["delay_ns"]["p50"] == 3 * MS
    assert row["differed_ns"] == 199 * 3 * MS
    assert row["observed_ns"] == 199 * 10 * MS
    assert row["equal"]


def test_who_is_first_is_told_by_the_changes_whoever_is_defined_first() -> None:
    positions = [struct.pack("<d", number * 0.5) for number in range(50)]
    frames = [sent_on_can(number * 10 * MS, data) for number, data in enumerate(positions)]
    frames += [sent_on_udp(number * 10 * MS + 8 * MS, data) for number, data in enumerate(positions)]
    (row,) = compared([on_udp(LREAL), on_can(LREAL)], frames)
    assert (row["from"]["list"], row["to"]["list"]) == ("can/can0/400", "udp/1202/7")
    assert (row["followed"], row["delay_ns"]["p50"]) == (49, 8 * MS)


def test_values_that_the_other_side_never_had_and_a_stuck_end() -> None:
    frames = []
    for number in range(100):
        frames.append(sent_on_udp(number * 10 * MS, struct.pack("<h", number)))
        if number != 60 and number < 90:
            frames.append(sent_on_can(number * 10 * MS + MS, struct.pack("<h", number)))
    frames.append(sent_on_can(600 * MS + MS, struct.pack("<h", -7)))
    (row,) = compared([on_udp(INT), on_can(INT)], frames)
    assert (row["changes"], row["followed"]) == (89, 88)
    assert (row["from"]["text"], row["to"]["text"], row["equal"]) == ("99", "89", False)
    on_the_way = 59 + 28  # a millisecond for each value from 1 to 59 and from 62 to 89
    wrong_value = 11  # from 60 on one side to 61 on the other
    stuck = 990 - 900
    assert row["differed_ns"] == (on_the_way + wrong_value + stuck) * MS


def test_texts_are_compared_up_to_their_end() -> None:
    string = String(7)
    texts = [b"left", b"right", b"left", b"up"]
    frames = [sent_on_udp(place * 10 * MS, text.ljust(8, b"\0")) for place, text in enumerate(texts)]
    frames += [sent_on_can(place * 10 * MS + MS, (text + b"\0").ljust(8, b"?")) for place, text in enumerate(texts)]
    (row,) = compared([on_udp(string), on_can(string)], frames)
    assert (row["changes"], row["followed"], row["equal"]) == (3, 3, True)


def test_only_variables_of_one_type_in_different_lists_are_compared() -> None:
    definition = Definition((on_udp(INT), on_can(LREAL)))
    hops = Hops(Layouts(definition))
    assert hops.untyped == ["v0"]
    assert compared([on_udp(INT), on_can(LREAL)], [sent_on_udp(0, b"\1\0"), sent_on_can(1, bytes(8))]) == []
    other = replace(on_udp(INT), list_id=8)
    alone = [sent_on_udp(place, struct.pack("<h", place)) for place in range(4)]
    assert compared([on_udp(INT), other], alone) == []


def one_by_one(led: list[tuple[int, int]], sent: list[tuple[int, int]]) -> dict[str, Any]:
    """Return what ``hop_rows`` is made of, for samples (time, value) of the end that leads and the one that follows."""
    seen: list[tuple[int, int]] = []
    found = {"changes": 0, "followed": 0, "delays": []}
    events = sorted([(at, 0, value) for at, value in led] + [(at, 1, value) for at, value in sent])
    last = None
    for at, who, value in events:
        if who == 0:
            if not seen or seen[-1][1] != value:
                seen.append((at, value))
            continue
        if last is not None and value != last and seen:
            found["changes"] += 1
            same = [place for place, (_, known) in enumerate(seen) if known == value]
            if same:
                found["followed"] += 1
                if same[-1]:
                    found["delays"].append(at - seen[same[-1]][0])
        last = value
    return found


@pytest.mark.parametrize(("seed", "cut"), crossed(range(20), [1, 5, 1000]))
def test_any_traffic_in_any_cut_is_compared_as_one_by_one(seed: int, cut: int) -> None:
    choice = random.Random(seed)
    samples: list[list[tuple[int, int]]] = [[], []]
    for at in sorted(choice.sample(range(1, 5000), 120)):
        samples[choice.randrange(2)].append((at * 1000, choice.randrange(choice.choice([2, 3, 40]))))
    frames = [sent_on_udp(at, struct.pack("<h", value)) for at, value in samples[0]]
    frames += [sent_on_can(at, struct.pack("<h", value)) for at, value in samples[1]]
    (row,) = compared([on_udp(INT), on_can(INT)], frames, cut)
    forth, back = one_by_one(*samples), one_by_one(*reversed(samples))
    told = forth if row["from"]["list"].startswith("udp") else back
    delays = told["delays"]
    assert (row["changes"], row["followed"]) == (told["changes"], told["followed"])
    expected = (len(delays), min(delays, default=None), max(delays, default=None))
    assert (row["delay_ns"]["count"], row["delay_ns"]["min"], row["delay_ns"]["max"]) == expected
    now: list[int | None] = [None, None]
    observed = differed = 0
    events = sorted((at, who, value) for who, own in enumerate(samples) for at, value in own)
    for place, (at, who, value) in enumerate(events):
        now[who] = value
        until = events[place + 1][0] if place + 1 < len(events) else at
        if None not in now:
            observed += until - at
            differed += (until - at) * (now[0] != now[1])
    assert (row["observed_ns"], row["differed_ns"]) == (observed, differed)
