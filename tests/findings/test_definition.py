"""NV405 to NV407: definitions that fit the wire, and in which way others do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition import causes
from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import pack
from nvscope.definition.position import Position
from nvscope.definition.variables import Array, String, Type, Variable
from nvscope.findings.finding import Finding
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.variables.values import Values
from tests.definition.lists import BOOL, HERE, INT, LINT, LREAL, REAL, TIME, UDINT, VARIABLES, list_of, telegram
from tests.laws import examples
from tests.oracle.frame import Frame
from tests.packets import batch_of, observed

START_NS = 1_700_000_000_000_000_000
STRING = String(9)
SENT = [BOOL, INT, REAL, LREAL]  # 15 bytes in 4 items


Sent = Sequence[tuple[int, bytes, int]]
"""SubIndex, data and Items of telegrams that are sent every 50 ms."""


def all_findings(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> list[Finding]:
    definition = Definition(lists)
    state = TrackerState(values=Values(Layouts(definition)))
    frames = [
        telegram(data, items, subindex=subindex, counter=number, ts_ns=START_NS + number * 50_000_000)
        for number, (subindex, data, items) in enumerate(sent)
    ]
    observed(state, [batch_of(frames)])
    return judge(state, definition=definition)


def judged(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> dict[str, list[tuple[str, int]]]:
    """Return messages and counts by code, without those that a change of shape brings."""
    found: dict[str, list[tuple[str, int]]] = {}
    for finding in all_findings(*lists, sent=sent):
        if finding.code in {"NV405", "NV406", "NV407"}:
            found.setdefault(finding.code, []).append((finding.message, finding.count))
    return found


def findings(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> dict[str, tuple[str, int]]:
    """Return message and count by code."""
    return {finding.code: (finding.message, finding.count) for finding in all_findings(*lists, sent=sent)}


def mismatch(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> Finding:
    """Return the only NV405 there is."""
    (found,) = (finding for finding in all_findings(*lists, sent=sent) if finding.code == "NV405")
    return found


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


def test_a_list_that_can_be_sent_packed_only_is_judged_all_the_same() -> None:
    """Unpacked it would need more telegrams than SubIndex can number; that this is tried is nobody's mistake."""
    ((message, count),) = judged(list_of([Array(((1, 70_000),), BOOL)]))["NV405"]
    assert message == (
        "1 telegram of 1: 4 items in 15 bytes, by the definition 256 in 256: v0[16] at byte 15 is the first that "
        "cannot be there, 241 bytes short."
    )
    assert count == 1


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


def test_a_list_on_can_is_not_near_one_on_udp() -> None:
    on_can = replace(list_of([LREAL], list_id=7), protocol="CAN", channel="can0")
    assert findings(on_can)["NV406"] == ("No definition is for list 7 on port 1202.", 1)
    elsewhere = findings(replace(list_of(SENT), list_id=7, port=1300), on_can)
    assert elsewhere["NV406"] == (
        "No definition is for list 7 on port 1202. The definition has list 7 on port 1300.",
        1,
    )


def hints(*lists: ListDefinition, sent: Sent = ((0, bytes(15), 4),)) -> dict[str, str]:
    return {finding.code: finding.hint for finding in all_findings(*lists, sent=sent)}


def test_a_silent_list_of_exactly_the_shape_of_an_unknown_one_is_perhaps_the_same() -> None:
    silent = replace(named("plant/ax8.gvl", SENT), list_id=8)
    assert hints(silent) == {
        "NV406": "List 8 (ax8.gvl) is silent and has exactly this shape: does the sender use another identifier?",
        "NV407": "List 7 is sent, has exactly this shape and no definition: does the sender use another identifier?",
    }
    elsewhere = hints(replace(silent, list_id=7, port=1300))
    assert elsewhere["NV406"].startswith("List 7 on port 1300 (ax8.gvl) is silent and has exactly this shape")
    assert elsewhere["NV407"].startswith("List 7 on port 1202 is sent, has exactly this shape and no definition")
    assert all(hint.endswith("does the sender use another port?") for hint in elsewhere.values())


def test_several_silent_lists_of_one_shape() -> None:
    lists = [replace(named(f"{number}.gvl", SENT), list_id=number) for number in (8, 9)]
    assert hints(*lists)["NV406"].startswith("List 8 (8.gvl) and list 9 (9.gvl) are silent and have exactly this shape")


@pytest.mark.parametrize(
    "sent",
    [
        [(0, bytes(15), 3)],
        [(0, bytes(14), 4)],
        [(1, bytes(15), 4)],
        [(0, bytes(15), 4), (1, bytes(2), 1)],
    ],
)  # fmt: skip
def test_a_silent_list_of_another_shape_is_another_list(sent: Sent) -> None:
    assert set(hints(list_of(SENT, list_id=8), sent=sent).values()) == {""}


def test_a_list_known_by_its_settings_only() -> None:
    settings_only = ListDefinition("io", HERE, (), list_id=7)
    assert findings(settings_only) == {}  # no file defines anything: what is undefined need not be said
    found = findings(settings_only, list_of(SENT, list_id=8), ListDefinition("", HERE, (), list_id=9))
    assert found["NV406"] == ("List 7 on port 1202 is known by its settings only, not by its variables.", 1)
    assert found["NV407"] == ("List udp/1202/9 is defined, but not one telegram of it was seen.", 1)


def test_without_definitions_nothing_is_missed() -> None:
    state = TrackerState()
    observed(state, [batch_of([telegram(bytes(15), 4, subindex=0, counter=1, ts_ns=START_NS)])])
    assert judge(state) == []


@st.composite
def definitions_and_traffic(draw: st.DrawFn) -> tuple[list[ListDefinition], Sent]:
    """Up to four definitions of a list, and telegrams of their shapes, or of no one's."""
    lists = [
        replace(list_of(draw(VARIABLES), pack=draw(st.booleans())), position=Position(f"{number}.gvl", 1, 1))
        for number in range(draw(st.integers(1, 4)))
    ]
    own = [(layout.subindex, layout.layout.size_bytes, layout.items) for entry in lists for layout in pack(entry)]
    others = st.tuples(st.integers(0, 4), st.integers(0, 40), st.integers(0, 9))
    sent = draw(st.lists(st.one_of(st.sampled_from(own), others) if own else others, min_size=1, max_size=30))
    return lists, [(subindex, bytes(size), items) for subindex, size, items in sent]


@given(definitions_and_traffic())
@examples(150)
def test_any_definitions_and_traffic_give_findings_that_hold_together(
    drawn: tuple[list[ListDefinition], Sent],
) -> None:
    lists, sent = drawn
    found = [finding for finding in all_findings(*lists, sent=sent) if finding.code == "NV405"]
    places = [(finding.list_number, finding.node, finding.subindex) for finding in found]
    assert len(places) == len(set(places))
    for finding in found:
        concerned = [number for number, (subindex, _, _) in enumerate(sent, 1) if finding.subindex in {None, subindex}]
        assert 0 < finding.count <= len(concerned)
        assert len(finding.frames) == min(finding.count, 10)
        assert list(finding.frames) == sorted(set(finding.frames))
        assert set(finding.frames) <= set(concerned)
    if not found and len(lists) == 1:
        shapes = [(layout.items, layout.length) for layout in pack(lists[0])]
        assert all(shapes[subindex] == (items, 20 + len(data)) for subindex, data, items in sent)


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
