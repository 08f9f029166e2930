"""NV405 to NV407: definitions that fit the wire, and in which way others do not."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Array, Definition, ListDefinition, Type
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.values import Values
from tests.definition.lists import BOOL, INT, LREAL, REAL, UDINT, list_of, telegram
from tests.packets import batch_of

START_NS = 1_700_000_000_000_000_000
SENT = [BOOL, INT, REAL, LREAL]  # 15 bytes in 4 items


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


def test_without_definitions_nothing_is_missed() -> None:
    state = TrackerState()
    state.observe(batch_of([telegram(bytes(15), 4, subindex=0, counter=1, ts_ns=START_NS)]))
    assert judge(state) == []
