"""NV405 to NV407: definitions that fit the wire, and in which way others do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Array, Definition, ListDefinition, Position, String, Type
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.values import Values
from tests.definition.lists import BOOL, HERE, INT, LREAL, REAL, UDINT, list_of, telegram
from tests.packets import batch_of

START_NS = 1_700_000_000_000_000_000
STRING = String(9)
SENT = [BOOL, INT, REAL, LREAL]  # 15 bytes in 4 items


def judged(
    *lists: ListDefinition, sent: Sequence[tuple[int, bytes, int]] = ((0, bytes(15), 4),)
) -> dict[str, list[tuple[str, int]]]:
    """Return messages and counts by code, without those that a change of shape brings; ``sent`` as below."""
    definition = Definition(lists)
    state = TrackerState(values=Values(Layouts(definition)))
    frames = [
        telegram(data, items, subindex=subindex, counter=number, ts_ns=START_NS + number * 50_000_000)
        for number, (subindex, data, items) in enumerate(sent)
    ]
    state.observe(batch_of(frames))
    found: dict[str, list[tuple[str, int]]] = {}
    for finding in judge(state, definition=definition):
        if finding.code in {"NV405", "NV406", "NV407"}:
            found.setdefault(finding.code, []).append((finding.message, finding.count))
    return found


def findings(
    *lists: ListDefinition, sent: Sequence[tuple[int, bytes, int]] = ((0, bytes(15), 4),)
) -> dict[str, tuple[str, int]]:
    """Return message and count by code; each of ``sent`` is SubIndex, data and Items of a telegram."""
    definition = Definition(lists)
    state = TrackerState(values=Values(Layouts(definition)))
    frames = [
        telegram(data, items, subindex=subindex, counter=number, ts_ns=START_NS + number * 50_000_000)
        for number, (subindex, data, items) in enumerate(sent)
    ]
    state.observe(batch_of(frames))
    return {finding.code: (finding.message, finding.count) for finding in judge(state, definition=definition)}


def test_what_fits_is_no_finding() -> None:
    assert findings(list_of(SENT)) == {}


@pytest.mark.parametrize(
    ("types", "message"),
    [
        ([BOOL, INT, REAL], "4 items in 15 bytes, by the definition 3 in 7: 8 bytes more than up to the end of v2."),
        (
            [BOOL, INT, REAL, UDINT, LREAL],
            "4 items in 15 bytes, by the definition 5 in 19: v4 at byte 11 is the first that cannot be there, 4 bytes",
        ),
        ([LREAL, REAL, INT, BOOL], ""),
        ([Array(((1, 15),), BOOL)], "4 items in 15 bytes, by the definition 15 in 15: other variables of the same"),
    ],
)  # fmt: skip
def test_the_first_variable_that_cannot_be_there(types: list[Type], message: str) -> None:
    found = findings(list_of(types))
    if message:
        assert found["NV405"][0].startswith(f"1 telegram of 1: {message}")
    else:
        assert found == {}  # the same sizes in another order cannot be told


@pytest.mark.parametrize(
    ("definition", "sent", "cause"),
    [
        (list_of([BOOL, INT, UDINT, REAL, LREAL]), [(0, 15, 4)], "It would fit without one of v2, v3: perhaps"),
        (list_of([BOOL, INT, STRING, REAL, LREAL]), [(0, 15, 4)], "It would fit without v2: perhaps"),
        (list_of([BOOL, INT, LREAL]), [(0, 15, 4)], "It would fit with one more variable of 4 bytes: perhaps"),
        (list_of([BOOL, INT]), [(0, 19, 6)], "It would fit with one more variable of 4 elements of 4 bytes: perhaps"),
        (list_of([BOOL, INT]), [(0, 15, 6)], ""),  # four elements of 3 bytes: no array is that
        (list_of([BOOL, INT, INT, LREAL]), [(0, 15, 4)], "Every item is there, so a type differs."),
        (list_of([STRING, INT]), [(0, 9, 2)], "Every item is there, so a type, or a STRING's length, differs."),
        (list_of([STRING, INT]), [(0, 9, 2), (0, 7, 2)], "It would fit if STRINGs were sent at their actual length"),
        (list_of(SENT, pack=False), [(0, 15, 4)], "It would fit if the list were packed."),
        (list_of([INT, INT]), [(0, 2, 1), (1, 2, 1)], "It would fit if the list were not packed."),
        (list_of([LREAL] * 40), [(1, 256, 32), (2, 64, 8)], "It would fit if SubIndex were counted from 1."),
        (list_of([LREAL] * 40 + [INT]), [(0, 256, 32), (1, 64, 8)], "It would fit without v40: perhaps"),
        (list_of(SENT), [(0, 200, 1)], ""),
    ],
)  # fmt: skip
def test_what_would_make_it_fit(definition: ListDefinition, sent: list[tuple[int, int, int]], cause: str) -> None:
    messages = judged(definition, sent=[(subindex, bytes(size), items) for subindex, size, items in sent])["NV405"]
    told = [message for message, _ in messages if "It would" in message or "Every item" in message]
    assert len(told) == bool(cause)
    assert cause in "".join(told)


def named(file: str, types: Sequence[Type], **settings: bool) -> ListDefinition:
    entry = list_of(types, **settings)
    return replace(entry, position=Position(file, 3, 1))


def test_with_the_files_of_both_sides_it_is_said_who_is_wrong() -> None:
    press, hmi = named("plant/press.gvl", SENT), named("plant/hmi.gvl", [BOOL, LREAL, REAL, LREAL])
    where = "it reads v1 : LREAL at byte 1, where press.gvl has v1 : INT"
    message = f"press.gvl fits what 10.0.0.1 sends; hmi.gvl does not: {where}."
    sent = [(0, bytes(15), 4)] * 3
    assert judged(press, hmi, sent=sent) == judged(hmi, press, sent=sent) == {"NV405": [(message, 3)]}


def test_the_file_that_fits_is_the_one_that_is_decoded() -> None:
    definition = Definition((named("hmi.gvl", [INT]), named("press.gvl", SENT)))
    values = Values(Layouts(definition))
    state = TrackerState(values=values)
    state.observe(batch_of([telegram(bytes(15), 4, subindex=0, counter=1, ts_ns=START_NS)]))
    assert [stream.layout.list.position.file for stream in values.streams.values()] == ["press.gvl"]
    assert not values.unfitting.count.any()


@pytest.mark.parametrize("cut", range(1, 6))
def test_any_cut_into_batches_chooses_the_same_file(cut: int) -> None:
    """Three telegrams that fit neither or the reader's file come first; the first that fits a file decides."""
    definition = Definition((named("hmi.gvl", [INT]), named("press.gvl", SENT)))
    sent = [(bytes(3), 1), (bytes(2), 1), (bytes(15), 4), (bytes(15), 4), (bytes(2), 1), (bytes(9), 9)]
    frames = [
        telegram(data, items, subindex=0, counter=number, ts_ns=START_NS + number)
        for number, (data, items) in enumerate(sent)
    ]
    values = Values(Layouts(definition))
    state = TrackerState(values=values)
    for part in (frames[:cut], frames[cut:]):
        state.observe(batch_of(part))
    assert [stream.layout.list.position.file for stream in values.streams.values()] == ["hmi.gvl"]
    assert [(stream.telegrams, values.unfitting.count[0]) for stream in values.streams.values()] == [(2, 4)]


def test_files_of_one_shape_cannot_be_told_apart() -> None:
    assert judged(named("a.gvl", SENT), named("b.gvl", [BOOL, INT, UDINT, LREAL])) == {}


def test_where_no_file_fits_each_says_how() -> None:
    found = judged(named("a.gvl", [BOOL, INT]), named("b.gvl", [LREAL]))
    assert found["NV405"][0][0] == (
        "1 telegram of 1: "
        "a.gvl: 4 items in 15 bytes, by the definition 2 in 3: 12 bytes more than up to the end of v1. "
        "b.gvl: 4 items in 15 bytes, by the definition 1 in 8: 7 bytes more than up to the end of v0."
    )


def test_files_of_one_name_are_told_apart_by_their_directories() -> None:
    found = judged(named("press/list.gvl", SENT), named("hmi/list.gvl", [BOOL, INT]))
    assert found["NV405"][0][0] == (
        "press/list.gvl fits what 10.0.0.1 sends; hmi/list.gvl does not: it has nothing at byte 3, where "
        "press/list.gvl has v2 : REAL."
    )


def test_more_telegrams_than_defined() -> None:
    found = findings(list_of(SENT), sent=[(0, bytes(15), 4), (1, bytes(2), 1)])
    assert found["NV405"] == ("1 telegram of 1: SubIndex 1 is sent, by the definition the list ends with 0.", 1)


def test_a_change_that_is_over() -> None:
    found = findings(list_of(SENT), sent=[(0, bytes(7), 3), (0, bytes(7), 3), (0, bytes(15), 4)])
    assert found["NV405"] == ("2 telegrams of 3: the last one fits again.", 2)


def test_lists_that_only_one_side_knows() -> None:
    found = findings(list_of(SENT, list_id=8))
    assert found["NV406"] == ("No definition is for list 7 on port 1202.", 1)
    assert found["NV407"] == ("List test (udp/1202/8) is defined, but not one telegram of it was seen.", 1)


def test_a_list_known_by_its_settings_only() -> None:
    settings_only = ListDefinition("io", HERE, (), list_id=7)
    assert findings(settings_only) == {}  # no file defines anything: what is undefined need not be said
    found = findings(settings_only, list_of(SENT, list_id=8), ListDefinition("", HERE, (), list_id=9))
    assert found["NV406"] == ("List 7 on port 1202 is known by its settings only, not by its variables.", 1)
    assert found["NV407"] == ("List udp/1202/9 is defined, but not one telegram of it was seen.", 1)


def test_without_definitions_nothing_is_missed() -> None:
    state = TrackerState()
    state.observe(batch_of([telegram(bytes(15), 4, subindex=0, counter=1, ts_ns=START_NS)]))
    assert judge(state) == []
