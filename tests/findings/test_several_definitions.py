"""NV405 where several files define a list: who is right, and when that changed."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition
from nvscope.definition.variables import Type, Variable
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values
from tests.definition.lists import BOOL, HERE, INT, LINT, LREAL, REAL, TIME, UDINT, telegram
from tests.findings.defined import SENT, START_NS, judged, mismatch, named
from tests.oracle.frame import Frame
from tests.packets import batch_of, observed
from tests.records import replace


def test_with_the_files_of_both_sides_it_is_said_who_is_wrong() -> None:
    press, hmi = named("plant/press.gvl", SENT), named("plant/hmi.gvl", [BOOL, LREAL, REAL, LREAL])
    where = "it reads v1 : LREAL at byte 1, where press.gvl has v1 : INT"
    message = f"press.gvl fits what 10.0.0.1 sends; hmi.gvl does not: {where}."
    sent = [(0, bytes(15), 4)] * 3
    assert judged(press, hmi, sent=sent) == judged(hmi, press, sent=sent) == {"NV405": [(message, 3)]}


def test_the_file_that_fits_is_the_one_that_is_decoded() -> None:
    values = Values(Layouts(Definition((named("hmi.gvl", [INT]), named("press.gvl", SENT)))))
    observed(TrackerState(values=values), [batch_of([telegram(bytes(15), 4, subindex=0, counter=1, ts_ns=START_NS)])])
    assert [fitted.layout.list.position.file for fitted in values.fitted(0)] == ["press.gvl"]
    assert not values.unfitting.count.any()


@pytest.mark.parametrize("cut", range(1, 24))
@pytest.mark.parametrize("odd", [False, True])
def test_any_cut_into_batches_finds_the_same(cut: int, odd: bool) -> None:
    """Two definitions one after the other, with and without a telegram that fits neither."""
    definition = Definition((named("hmi.gvl", [INT]), named("press.gvl", SENT)))
    sent = [(bytes(2), 1)] * 12 + [(bytes(9), 9)] * odd + [(bytes(15), 4)] * 12
    frames = [
        telegram(data, items, subindex=0, counter=number, ts_ns=START_NS + number)
        for number, (data, items) in enumerate(sent)
    ]

    def found(parts: Sequence[Sequence[Frame]]) -> list[Finding]:
        state = observed(TrackerState(values=Values(Layouts(definition))), map(batch_of, parts))
        return [finding for finding in judge(state, definition=definition) if finding.code == "NV405"]

    whole = found([frames])
    assert found([frames[:cut], frames[cut:]]) == whole
    assert ["a download?" in finding.message for finding in whole] == [not odd]


@pytest.mark.parametrize(
    ("theirs", "first"),
    [
        ([BOOL, INT, UDINT, LREAL], "from byte 3 on (v2 : REAL / v2 : UDINT)"),
        ([REAL, INT, BOOL, LREAL], "from byte 0 on (v0 : BOOL / v0 : REAL)"),
    ],
)  # fmt: skip
def test_files_of_one_shape_that_mean_something_else_cannot_both_be_right(theirs: list[Type], first: str) -> None:
    found = mismatch(named("plc/a.gvl", SENT), named("hmi/b 2.gvl", theirs), sent=[(0, bytes(15), 4)] * 12)
    assert found.message == (
        f"Both a.gvl and b 2.gvl fit what 10.0.0.1 sends, and differ {first}: the telegrams cannot tell which is "
        "right; values are shown by a.gvl."
    )
    assert found.hint.startswith("`nvscope gvl diff plc/a.gvl 'hmi/b 2.gvl'` shows all that differs")
    assert (found.subindex, found.count, found.frames) == (0, 12, tuple(range(1, 11)))


def test_files_that_say_the_same_under_other_names_are_both_right() -> None:
    renamed = tuple(Variable(f"w{place}", kind, HERE) for place, kind in enumerate(SENT))
    assert judged(named("a.gvl", SENT), replace(named("b.gvl", SENT), variables=renamed)) == {}
    assert judged(named("a.gvl", SENT), named("copy.gvl", SENT)) == {}


def test_files_that_differ_only_in_telegrams_nobody_sends_are_both_right() -> None:
    long = [LREAL] * 32
    assert judged(named("a.gvl", [*long, INT]), named("b.gvl", [*long, BOOL]), sent=[(0, bytes(256), 32)]) == {}


def test_two_files_of_one_shape_and_one_of_another_are_one_finding() -> None:
    found = mismatch(named("a.gvl", SENT), named("c.gvl", [INT]), named("b.gvl", [BOOL, INT, UDINT, LREAL]))
    assert found.message.startswith("Both a.gvl and b.gvl fit what 10.0.0.1 sends, and differ from byte 3 on")
    assert found.message.endswith(
        "values are shown by a.gvl. c.gvl does not fit: it reads v0 : INT at byte 0, where a.gvl has v0 : BOOL."
    )


def test_values_are_shown_by_the_first_file_whose_telegram_it_is_even_if_that_does_not_fit_the_others() -> None:
    long = [LREAL] * 32
    lists = (
        named("wrong.gvl", [*long, BOOL]), named("a.gvl", [*long, INT]), named("b.gvl", [TIME, *long[1:], TIME, INT]),
        named("c.gvl", [LINT, *long[1:], INT]),
    )  # fmt: skip
    found = mismatch(*lists, sent=[(0, bytes(256), 32), (1, bytes(2), 1)])
    assert "Both a.gvl and c.gvl fit" in found.message
    assert "from byte 0 of SubIndex 0 on (v0 : LREAL / v0 : LINT)" in found.message
    assert "values are shown by wrong.gvl." in found.message


def test_what_does_not_fit_the_wrong_file_is_told_by_its_first_ten_frames() -> None:
    found = mismatch(named("press.gvl", SENT), named("hmi.gvl", [INT]), sent=[(0, bytes(15), 4)] * 30)
    assert (found.count, found.frames) == (30, tuple(range(1, 11)))


DOWNLOADED = named("new.gvl", [*SENT, INT])


@pytest.mark.parametrize("order", [1, -1])
def test_a_download_in_the_middle(order: int) -> None:
    lists = [named("old.gvl", SENT), DOWNLOADED][::order]
    found = mismatch(*lists, sent=[(0, bytes(15), 4)] * 6 + [(0, bytes(17), 5)] * 12)
    assert found.message == (
        "old.gvl fits what 10.0.0.1 sends up to T#250ms, new.gvl from T#300ms on (frame 7): a download?"
    )
    assert (found.subindex, found.count, found.frames) == (0, 12, tuple(range(7, 17)))
    assert found.hint == "`nvscope gvl diff old.gvl new.gvl` shows what changed; from then on, readers need new.gvl."


def test_a_download_that_brings_a_telegram_more() -> None:
    long = [LREAL] * 32
    found = mismatch(
        named("old.gvl", long), named("new.gvl", [*long, INT]),
        sent=[(0, bytes(256), 32)] * 3 + [(0, bytes(256), 32), (1, bytes(2), 1)] * 3,
    )  # fmt: skip
    assert found.message.startswith("new.gvl fits what 10.0.0.1 sends; old.gvl does not: it has nothing at byte 0")


def test_a_sender_that_goes_to_and_fro_between_definitions_is_no_download() -> None:
    found = mismatch(named("old.gvl", SENT), DOWNLOADED, sent=[(0, bytes(15), 4), (0, bytes(17), 5)] * 3)
    assert found.message.startswith("3 telegrams of 6: old.gvl: 5 items in 17 bytes")
    assert "new.gvl: the last one fits again." in found.message


def test_files_of_one_name_are_told_apart_by_their_directories() -> None:
    found = judged(named("press/list.gvl", SENT), named("hmi/list.gvl", [BOOL, INT]))
    assert found["NV405"][0][0] == (
        "press/list.gvl fits what 10.0.0.1 sends; hmi/list.gvl does not: it has nothing at byte 3, where "
        "press/list.gvl has v2 : REAL."
    )
