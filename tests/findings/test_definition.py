"""NV405 to NV407: lists that fit their definition, and lists that only one side knows."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition.model import ListDefinition
from nvscope.definition.packing import pack
from nvscope.definition.position import Position
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from tests.definition.lists import HERE, LREAL, VARIABLES, list_of, telegram
from tests.findings.defined import SENT, START_NS, Sent, all_findings, findings, named
from tests.laws import examples
from tests.packets import batch_of, observed
from tests.records import replace


def test_what_fits_is_no_finding() -> None:
    assert findings(list_of(SENT)) == {}


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
