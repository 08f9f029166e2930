"""Lists on CAN against each other and against CANopen: told from definitions alone, with what a capture adds."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from dissectors.can.canopen import PREDEFINED
from nvscope.definition.cob_ids import canopen_ids, canopen_uses, overlaps, taken_in
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.pdos import Pdos
from nvscope.definition.position import Position
from nvscope.engine.reading import Reading
from nvscope.findings.judge import judge
from nvscope.tracker.state import TrackerState
from nvscope.tracker.summary import summarize
from nvscope.view.documents.report import report_document
from tests.definition.lists import LREAL, list_of
from tests.packets import observed
from tests.records import replace
from tests.tracker.can.test_state import START_NS, Frame, batch


def on_can(name: str, cob_id: int, frames: int) -> ListDefinition:
    """Return a list that takes so many COB-IDs."""
    entry = list_of([LREAL] * frames, list_id=cob_id)
    return replace(entry, protocol="CAN", name=name, position=Position(f"{name}.gvl", 3, 1))


def findings(lists: list[ListDefinition], frames: list[Frame], *codes: str) -> list[dict[str, Any]]:
    definition = Definition(tuple(lists))
    state = TrackerState()
    if frames:
        observed(state, [batch(frames)], Reading(pdos=Pdos(definition).rules()), ["can0", "can1"])
    summary = summarize(state)
    document = report_document(summary, judge(state, summary=summary, definition=definition), [], definition)
    return [finding for finding in document["findings"] if finding["code"] in codes]


def test_lists_that_overlap_are_told_with_the_frames_that_were_seen() -> None:
    """press takes 0x190 to 0x192, saw 0x192: on can1 there are two frames of 0x192, on can0 none."""
    lists = [on_can("press", 0x240, 3), on_can("saw", 0x242, 1)]
    frames = [(START_NS + place, 1, word, bytes(8)) for place, word in enumerate([0x240, 0x241, 0x242, 0x242])]
    (found,) = findings(lists, [*frames, (START_NS + 9, 0, 0x555, b"")], "NV601")
    assert found["message"] == (
        "press (press.gvl) takes 0x240 to 0x242; saw (saw.gvl, 0x242) takes 0x242 too. "
        "On can1, 2 frames of 0x242 were seen."
    )
    assert (found["list"], found["count"], found["frames"]) == ("can/can1/576", 2, [3])
    assert (found["first_ns"], found["last_ns"]) == (str(START_NS + 2), str(START_NS + 3))


def test_a_list_whose_cob_ids_were_seen_as_those_of_another_is_not_silent() -> None:
    lists = [on_can("a", 0x110, 3), on_can("b", 0x111, 1), on_can("c", 0x120, 1)]
    frames: list[Frame] = [(START_NS + place, 0, cob_id, bytes(8)) for place, cob_id in enumerate([0x110, 0x111])]
    assert ["List c" in found["message"] for found in findings(lists, frames, "NV407")] == [True]
    # Where its own COB-IDs were not seen, it is silent, be there an overlap or not.
    assert len(findings(lists, frames[:1], "NV407")) == 2


def test_an_overlap_is_one_of_the_definition_even_if_nothing_is_sent() -> None:
    lists = [on_can("press", 0x240, 2), on_can("saw", 0x241, 2), on_can("lift", 0x241, 1)]
    told = findings(lists, [], "NV601")
    assert [(one["count"], one["first_ns"], one["frames"], one["list"]) for one in told] == [
        (1, None, [], "can/*/576"), (1, None, [], "can/*/577"),
    ]  # fmt: skip
    assert told[0]["message"] == (
        "press (press.gvl) takes 0x240 to 0x241; saw (saw.gvl, 0x241 to 0x242) and lift (lift.gvl, 0x241) "
        "take 0x241 too."
    )


def test_the_files_of_both_sides_of_a_list_do_not_overlap() -> None:
    sender, reader = (replace(on_can("press", 0x240, 2), position=Position(side, 3, 1)) for side in ("a", "b"))
    assert findings([sender, reader], [], "NV601") == []
    assert len(findings([sender, reader], [], "NV602")) == 1


def test_what_canopen_uses_is_named_with_service_and_node() -> None:
    lists = [on_can("press", 0x181, 3)]
    frames = [(START_NS + place, 0, word, bytes(8)) for place, word in enumerate([0x181, 0x182, 0x181])]
    (alone,) = findings(lists, frames, "NV602")
    assert alone["message"] == (
        "press takes 0x181 to 0x183, which CANopen uses for TPDO1 of nodes 1 to 3. "
        "On can0, 3 frames of 0x181 to 0x182 were seen. "
        "Nothing of CANopen was seen there: no heartbeat, no boot-up, no NMT command, no SDO with its answer."
    )
    assert (alone["list"], alone["count"], alone["frames"]) == ("can/can0/385", 3, [1, 2])
    frames += [(START_NS + 5, 0, 0x702, b"\5"), (START_NS + 6, 0, 0x709, b"\5")]
    (beside,) = findings(lists, frames, "NV602")
    assert beside["message"].endswith("CANopen devices are there: node 2 and node 9; COB-IDs of node 2 collide.")


def test_a_list_outside_of_every_range_is_fine() -> None:
    assert findings([on_can("press", 0x680, 8), on_can("saw", 0x688, 2)], [], "NV601", "NV602") == []


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.integers(1, 9)), max_size=12))
def test_overlaps_and_services_are_those_found_identifier_by_identifier(ranges: list[tuple[int, int]]) -> None:
    definition = Definition(tuple(on_can(f"l{place}", *one) for place, one in enumerate(ranges)))
    taken = taken_in(definition)
    sets = [set(range(first, first + frames)) for first, frames in ranges]
    pairs = [(a, b) for a in range(len(sets)) for b in range(a + 1, len(sets)) if sets[a] & sets[b]]
    found = [(taken.index(one), taken.index(other)) for one, other in overlaps(taken)]
    assert found == pairs
    for (one, other), (a, b) in zip(overlaps(taken), pairs, strict=True):
        assert set(one.shared(other)) == sets[a] & sets[b]
    used = {cob_id for service in PREDEFINED for cob_id in range(service.first, service.last + 1)}
    for entry, own in zip(taken, sets, strict=True):
        assert set(canopen_ids(entry)) == own & used
        assert bool(canopen_uses(entry)) == bool(own & used)
