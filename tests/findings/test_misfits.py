"""NV405: in which way telegrams do not fit their definition, and what would make them fit."""

from __future__ import annotations

import pytest

from nvscope.definition import causes
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.variables import Array, Type
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values
from tests.definition.lists import BOOL, INT, LREAL, REAL, UDINT, list_of, telegram
from tests.findings.defined import SENT, STRING, findings, judged, mismatch, named
from tests.packets import batch_of, observed


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


def test_a_list_that_can_be_sent_packed_only_is_judged_all_the_same() -> None:
    """Unpacked it would need more telegrams than SubIndex can number; that this is tried is nobody's mistake."""
    ((message, count),) = judged(list_of([Array(((1, 70_000),), BOOL)]))["NV405"]
    assert message == (
        "1 telegram of 1: 4 items in 15 bytes, by the definition 256 in 256: v0[16] at byte 15 is the first that "
        "cannot be there, 241 bytes short."
    )
    assert count == 1


def test_one_cause_of_all_subindexes_is_one_finding() -> None:
    """A list that is sent unpacked, each variable in a telegram of its own, and defined as packed."""
    cycle = [(number, bytes(kind.size_bytes), 1) for number, kind in enumerate((BOOL, INT, REAL, LREAL))]
    found = mismatch(list_of(SENT), sent=cycle * 5)
    assert found.message == (
        "20 telegrams of 20, in 4 SubIndexes: SubIndex 0 has 1 item in 1 byte, by the definition 4 in 15: v1 at byte "
        "1 is the first that cannot be there, 14 bytes short. It would fit if the list were not packed."
    )
    assert found.hint == (
        "Set Pack to FALSE in the definition, as the sender has it (or pack = false under [lists.7] in nvscope.toml), "
        "and in the readers."
    )
    assert (found.subindex, found.count, found.frames) == (None, 20, tuple(range(1, 11)))


def test_one_cause_of_all_subindexes_with_several_files() -> None:
    cycle = [(number, bytes(kind.size_bytes), 1) for number, kind in enumerate((BOOL, INT, REAL, LREAL))]
    found = mismatch(named("old.gvl", [INT]), named("press.gvl", SENT), sent=cycle * 2)
    assert found.message.endswith("press.gvl would fit if the list were not packed.")
    assert found.count == 8


def test_strings_of_their_actual_length_are_a_matter_of_the_sender() -> None:
    found = mismatch(list_of([STRING, INT]), sent=[(0, bytes(9), 2), (0, bytes(7), 2)])
    assert found.hint.startswith("Make the sender fill each STRING with zeros")


def test_where_no_file_fits_each_says_how() -> None:
    found = judged(named("a.gvl", [BOOL, INT]), named("b.gvl", [LREAL]))
    assert found["NV405"][0][0] == (
        "1 telegram of 1: "
        "a.gvl: 4 items in 15 bytes, by the definition 2 in 3: 12 bytes more than up to the end of v1. "
        "b.gvl: 4 items in 15 bytes, by the definition 1 in 8: 7 bytes more than up to the end of v0."
    )


def test_more_telegrams_than_defined() -> None:
    found = findings(list_of(SENT), sent=[(0, bytes(15), 4), (1, bytes(2), 1)])
    assert found["NV405"] == ("1 telegram of 1: SubIndex 1 is sent, by the definition the list ends with 0.", 1)


def test_a_change_that_is_over() -> None:
    found = findings(list_of(SENT), sent=[(0, bytes(7), 3), (0, bytes(7), 3), (0, bytes(15), 4)])
    assert found["NV405"] == ("2 telegrams of 3: the last one fits again.", 2)


def test_a_cause_is_looked_for_once_for_all_senders_of_the_same_shapes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each try packs the whole list: a capture of many senders must not repeat it for each of them."""
    tried = []
    monkeypatch.setattr(causes, "likely_cause", lambda *_, **__: tried.append(1))
    frames = []
    for number in range(60):
        frame = telegram(b"\1\2\3", 3, subindex=0, counter=1, ts_ns=1 + number)
        frames.append(frame._replace(data=frame.data[:29] + bytes([number + 1]) + frame.data[30:]))
    definition = Definition((list_of([INT, REAL]),))
    state = TrackerState(values=Values(Layouts(definition)))
    observed(state, [batch_of(frames)])
    found = [finding for finding in judge(state, definition=definition) if finding.code == "NV405"]
    assert (len(found), len(tried)) == (60, 1)
