"""Definitions compared: what differs, and what a reader of B makes of A's bytes. By readable samples, and by laws."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nvscope.definition.byte_map import Relation, Run, Stretch, meaning_of
from nvscope.definition.difference import Difference, ListDifference, difference, list_difference
from nvscope.definition.load import load_definitions
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.packing import pack
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Scalar, ScalarKind, String, Type, Variable
from tests.definition.lists import INT, VARIABLES, list_of
from tests.records import replace

CONSTANTS = "TYPE Axis : STRUCT pos : LREAL; vel : REAL; END_STRUCT END_TYPE\n"


def definition(text: str, path: Path, name: str, types: str = CONSTANTS) -> Definition:
    """Return a definition of one list, ``bRun : BOOL; …``."""
    file = path / f"{name}.st"
    file.write_text(f"{types}VAR_GLOBAL {text} END_VAR", encoding="utf-8")
    return load_definitions([str(file)])


def compared(a: str, b: str, path: Path, b_types: str = CONSTANTS) -> ListDifference:
    (found,) = difference(definition(a, path, "a"), definition(b, path, "b", b_types)).lists
    return found


def part_text(part: Stretch | None) -> str:
    if part is None:
        return "-"
    return part.first if part.count == 1 else f"{part.first}..{part.last}"


def rows(runs: tuple[Run, ...]) -> list[str]:
    """Return a byte map as texts: ``4-7 other nCount -> nState``."""
    return [
        f"{run.first_byte}-{run.last_byte} {run.relation.value} {part_text(run.a)} -> {part_text(run.b)}"
        for run in runs
    ]


def changes(found: ListDifference) -> list[tuple[str, ...]]:
    return [tuple(text for text in (entry.change, entry.name, entry.a, entry.b) if text) for entry in found.variables]


BASE = "bRun : BOOL; nState : INT; rForce : REAL; stAxis : Axis; aPos : ARRAY [0..3] OF DINT;"


@pytest.mark.parametrize(
    ("b", "said", "accepted", "same", "byte_map"),
    [
        (BASE, [], True, True, ["0-34 same bRun..aPos[3] -> bRun..aPos[3]"]),
        (
            BASE.replace("rForce : REAL; ", ""),
            [("removed", "rForce", "REAL")],
            False,
            False,
            [
                "0-2 same bRun..nState -> bRun..nState",
                "3-10 other rForce..stAxis.pos -> stAxis.pos",
                "11-14 other stAxis.pos -> stAxis.vel",
                "15-18 other stAxis.vel -> aPos[0]",
                "19-30 other aPos[0]..aPos[2] -> aPos[1]..aPos[3]",
                "31-34 surplus aPos[3] -> -",
            ],
        ),
        (
            BASE.replace("nState : INT", "nState : DINT"),
            [("retyped", "nState", "INT", "DINT")],
            False,
            False,
            [
                "0-0 same bRun -> bRun",
                "1-4 other nState..rForce -> nState",
                "5-8 other rForce..stAxis.pos -> rForce",
                "9-16 other stAxis.pos..stAxis.vel -> stAxis.pos",
                "17-20 other stAxis.vel..aPos[0] -> stAxis.vel",
                "21-32 other aPos[0]..aPos[3] -> aPos[0]..aPos[2]",
                "33-36 other aPos[3] -> aPos[3]",
            ],
        ),
        (
            "nState : INT; bRun : BOOL; rForce : REAL; stAxis : Axis; aPos : ARRAY [0..3] OF DINT;",
            [("moved", "bRun", "first", "behind nState")],
            True,
            False,
            [
                "0-1 other bRun..nState -> nState",
                "2-2 other nState -> bRun",
                "3-34 same rForce..aPos[3] -> rForce..aPos[3]",
            ],
        ),
        (
            BASE.replace("rForce", "rPressure"),
            [("renamed", "rForce", "rForce", "rPressure")],
            True,
            True,
            [
                "0-2 same bRun..nState -> bRun..nState",
                "3-6 renamed rForce -> rPressure",
                "7-34 same stAxis.pos..aPos[3] -> stAxis.pos..aPos[3]",
            ],
        ),
        (
            BASE.replace("[0..3]", "[1..4]"),
            [("retyped", "aPos", "ARRAY [0..3] OF DINT", "ARRAY [1..4] OF DINT")],
            True,
            True,
            ["0-18 same bRun..stAxis.vel -> bRun..stAxis.vel", "19-34 renamed aPos[0]..aPos[3] -> aPos[1]..aPos[4]"],
        ),
        (
            BASE + "sText : STRING(10);",
            [("added", "sText", "STRING(10)")],
            False,
            False,
            ["0-34 same bRun..aPos[3] -> bRun..aPos[3]", "35-45 missing - -> sText"],
        ),
        (
            BASE.replace("rForce : REAL", "rForce : UDINT"),
            [("retyped", "rForce", "REAL", "UDINT")],
            True,
            False,
            [
                "0-2 same bRun..nState -> bRun..nState",
                "3-6 other rForce -> rForce",
                "7-34 same stAxis.pos..aPos[3] -> stAxis.pos..aPos[3]",
            ],
        ),
    ],
)  # fmt: skip
def test_what_a_reader_of_b_makes_of_a(
    b: str, said: list[tuple[str, ...]], accepted: bool, same: bool, byte_map: list[str], tmp_path: Path
) -> None:
    found = compared(BASE, b, tmp_path)
    assert changes(found) == said
    (telegram,) = found.telegrams
    assert (telegram.accepted, telegram.same) == (accepted, same)
    assert rows(telegram.runs) == byte_map


def test_types_that_differ_between_the_sides_matter(tmp_path: Path) -> None:
    found = compared(BASE, BASE, tmp_path, CONSTANTS.replace("vel : REAL", "speed : REAL"))
    assert changes(found) == [("retyped", "stAxis", "stAxis.vel : REAL", "stAxis.speed : REAL")]
    assert found.same_on_wire
    swapped = "TYPE Axis : STRUCT vel : REAL; pos : LREAL; END_STRUCT END_TYPE\n"
    found = compared(BASE, BASE, tmp_path, swapped)
    assert not found.same_on_wire
    assert found.telegrams[0].accepted


@pytest.mark.parametrize(("a", "b"), [("BYTE", "USINT"), ("eState", "INT"), ("DINT", "DINT(0..7)"), ("TIME", "TIME")])
def test_types_that_mean_the_same(a: str, b: str, tmp_path: Path) -> None:
    types = "TYPE eState : (eOff, eRun); END_TYPE\n"
    sides = (definition(f"x : {kind};", tmp_path, name, types) for name, kind in (("a", a), ("b", b)))
    assert difference(*sides).same_on_wire


@pytest.mark.parametrize(("a", "b"), [("INT", "UINT"), ("UDINT", "TIME"), ("REAL", "DINT"), ("STRING(3)", "DINT")])
def test_types_of_one_size_that_do_not_mean_the_same(a: str, b: str, tmp_path: Path) -> None:
    found = compared(f"x : {a};", f"x : {b};", tmp_path)
    assert found.telegrams[0].accepted
    assert not found.same_on_wire


def test_what_follows_an_element_of_unknown_size_is_not_compared(tmp_path: Path) -> None:
    found = compared("a : INT; p : POINTER TO INT; b : INT;", "a : INT; p : POINTER TO INT; b : INT;", tmp_path)
    assert rows(found.telegrams[0].runs) == ["0-1 same a -> a"]
    assert found.telegrams[0].accepted is None
    assert found.same_on_wire is None
    assert not found.empty
    assert found.may_be_same
    found = compared("p : POINTER TO INT; b : INT;", "p : POINTER TO INT; b : DINT;", tmp_path)
    assert found.same_on_wire is None
    assert not found.may_be_same


LONG = "b : ARRAY [0..299] OF BYTE; z : "
NO_PLACE = "a : BYTE; p : POINTER TO BOOL; "


@pytest.mark.parametrize(
    ("a", "b", "same", "byte_maps"),
    [
        (f"{NO_PLACE}{LONG}DINT;", f"{NO_PLACE}{LONG}REAL;", None, [["0-0 same a -> a"]]),
        (f"{NO_PLACE}{LONG}DINT;", f"a : BYTE; {LONG}REAL;", None, [["0-0 same a -> a"]]),
        (f"a : BYTE; {LONG}REAL;", f"{NO_PLACE}{LONG}DINT;", None, [["0-0 same a -> a"]]),
        ("p : Unheard; x : INT;", "p : Unheard; x : INT;", None, [[]]),
        ("p : Unheard;", "x : INT; y : INT;", None, [[]]),
        # What lies in front is known, and so is an element that reaches into what is not.
        ("a : INT; p : POINTER TO INT;", "b : DINT; c : INT;", False, [["0-3 other a -> b"]]),
        ("b : DINT; c : INT;", "a : INT; p : POINTER TO INT;", False, [["0-1 other b -> a"]]),
        ("a : INT; b : INT; p : Unheard;", "a : INT;", False, [["0-1 same a -> a", "2-3 surplus b -> -"]]),
        ("a : INT;", "a : INT; b : INT; p : Unheard;", False, [["0-1 same a -> a", "2-3 missing - -> b"]]),
        # One side ends with a telegram that the other surely goes on behind.
        (
            "x : ARRAY [1..256] OF BYTE; y : INT; p : Unheard;", "x : ARRAY [1..256] OF BYTE;", False,
            [["0-255 same x[1]..x[256] -> x[1]..x[256]"], ["0-1 surplus y -> -"]],
        ),
    ],
)  # fmt: skip
def test_from_an_element_without_a_place_on_all_is_unknown_and_all_in_front_is_not(
    a: str, b: str, same: bool | None, byte_maps: list[list[str]], tmp_path: Path
) -> None:
    found = compared(a, b, tmp_path)
    assert found.same_on_wire is same
    assert [rows(telegram.runs) for telegram in found.telegrams] == byte_maps
    assert [telegram.unknown for telegram in found.telegrams][-1]
    assert not any(telegram.accepted for telegram in found.telegrams if telegram.unknown)


def test_without_packing_only_the_telegram_of_an_unknown_element_is_unknown() -> None:
    unknown = Scalar("Unheard", ScalarKind.RAW, "V0", 0)
    found = list_difference(*[list_of([INT, unknown, INT], pack=False)] * 2)
    assert [telegram.same for telegram in found.telegrams] == [True, None, True]
    assert [telegram.a and telegram.a.shape for telegram in found.telegrams] == [(1, 22), (1, None), (1, 22)]


def on_can(*types: Type, list_id: int | None = 0x110) -> ListDefinition:
    return replace(list_of(types, list_id=list_id), protocol="CAN")


DWORD, LWORD = SCALARS["DWORD"], SCALARS["LWORD"]


def test_frames_have_a_dlc_and_no_items() -> None:
    (telegram,) = list_difference(on_can(DWORD, DWORD), on_can(LWORD)).telegrams
    assert (telegram.accepted, telegram.same) == (True, False)
    assert telegram.a
    assert telegram.a.shape == (None, 8)
    (telegram,) = list_difference(on_can(DWORD, DWORD), on_can(DWORD)).telegrams
    assert (telegram.accepted, telegram.same) == (False, False)


@pytest.mark.parametrize("beyond", [String(20), Scalar("Unheard", ScalarKind.RAW, "V0", 0)])
def test_behind_what_no_frame_holds_nothing_is_known(beyond: Type) -> None:
    a, b = on_can(LWORD, INT, beyond, INT), on_can(LWORD, INT, beyond, DWORD)
    found = list_difference(a, b)
    assert found.same_on_wire is None
    assert found.telegrams[0].same is True
    assert found.telegrams[-1].unknown
    assert list_difference(a, on_can(DWORD, beyond)).same_on_wire is False


def test_a_list_on_can_has_no_port_and_no_checksum() -> None:
    a = on_can(INT)
    found = list_difference(a, replace(a, port=1203, checksum=True, acknowledge=True))
    assert found.same_on_wire
    assert [entry.name for entry in found.settings] == ["checksum", "acknowledge"]
    two = Definition((a, on_can(INT, list_id=0x120)))
    moved = Definition(tuple(replace(entry, port=9, name="x") for entry in two.lists))
    assert [entry.b.list_id for entry in difference(two, moved).lists] == [0x110, 0x120]


def test_lists_on_can_and_on_udp_share_no_telegram() -> None:
    found = difference(Definition((on_can(INT),)), Definition((list_of([INT], list_id=0x110),))).lists[0]
    assert (found.same_on_wire, found.telegrams) == (False, ())


def test_more_telegrams_on_one_side(tmp_path: Path) -> None:
    found = compared("a : ARRAY [0..300] OF BYTE;", "a : ARRAY [0..255] OF BYTE;", tmp_path)
    assert [(telegram.accepted, telegram.same) for telegram in found.telegrams] == [(True, True), (False, False)]
    assert found.telegrams[1].b is None


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({"list_id": 8}, False),
        ({"port": 1203}, False),
        ({"checksum": True}, False),
        ({"acknowledge": True}, False),
        ({"interval_ns": 5}, True),
        ({"address": "10.0.0.255"}, True),
        ({"cyclic": False}, True),
        ({"list_id": None}, True),  # nobody said that it differs
        ({"protocol": "udp"}, True),
    ],
)
def test_settings_that_telegrams_show(change: dict[str, object], same: bool) -> None:
    a = list_of([INT], list_id=7)
    found = list_difference(a, replace(a, **change))  # type: ignore[arg-type]
    assert found.same_on_wire is same
    assert [entry.name for entry in found.settings] == [name for name in change if change != {"protocol": "udp"}]


def pairs(found: Difference) -> list[tuple[str, str]]:
    return [(entry.a.name, entry.b.name) for entry in found.lists]


def named(name: str, list_id: int | None, port: int = 1202) -> ListDefinition:
    return replace(list_of([INT]), name=name, list_id=list_id, port=port)


def test_lists_belong_together_by_identifier_then_by_name_then_alone() -> None:
    a = Definition((named("press", 7), named("hmi", None), named("oven", 9)))
    b = Definition((named("PRESSE", 7), named("HMI", 8), named("furnace", 10)))
    found = difference(a, b)
    assert pairs(found) == [("press", "PRESSE"), ("hmi", "HMI"), ("oven", "furnace")]
    assert (found.only_a, found.only_b) == ((), ())


def test_lists_that_only_one_side_has() -> None:
    a = Definition((named("press", 7), named("one", 1), named("two", 2)))
    found = difference(a, Definition((named("press", 7), named("three", 3))))
    assert pairs(found) == [("press", "press")]
    assert [entry.name for entry in found.only_a] == ["one", "two"]
    assert [entry.name for entry in found.only_b] == ["three"]
    assert not found.same_on_wire


# --- laws


@given(VARIABLES, st.booleans())
def test_nothing_differs_from_itself(types: list[Type], packed: bool) -> None:
    a = list_of(types, pack=packed)
    (found,) = difference(Definition((a,)), Definition((replace(a),))).lists
    assert found.empty
    assert found.same_on_wire
    assert all(run.relation is Relation.SAME for telegram in found.telegrams for run in telegram.runs)


def wire(entry: ListDefinition) -> list[list[object]]:
    return [[meaning_of(element.type) for element in layout.elements] for layout in pack(entry)]


@given(VARIABLES, VARIABLES, st.booleans(), st.booleans())
def test_same_on_the_wire_means_equal_layouts(a: list[Type], b: list[Type], packed: bool, renamed: bool) -> None:
    ours, theirs = list_of(a, pack=packed), list_of(b, pack=packed)
    if renamed:
        others = tuple(Variable(f"w{place}", kind.type, kind.position) for place, kind in enumerate(theirs.variables))
        theirs = replace(theirs, variables=others)
    found = list_difference(ours, theirs)
    # Members of one name in both, at different places, are told apart though their bytes are alike.
    crossed = any(telegram.a and telegram.b and telegram.accepted and not telegram.same for telegram in found.telegrams)
    assert found.same_on_wire == (wire(ours) == wire(theirs) and not crossed)
    assert found.same_on_wire or wire(ours) != wire(theirs) or not renamed


@given(VARIABLES, VARIABLES)
def test_byte_maps_hold_each_byte_of_b_once_and_are_mirrored(a: list[Type], b: list[Type]) -> None:
    found = list_difference(list_of(a), list_of(b))
    mirrored = list_difference(list_of(b), list_of(a))
    assert found.same_on_wire == mirrored.same_on_wire
    assert [entry.accepted for entry in found.telegrams] == [entry.accepted for entry in mirrored.telegrams]
    for telegram in found.telegrams:
        covered = [byte for run in telegram.runs for byte in range(run.first_byte, run.last_byte + 1)]
        longest = max(side.layout.layout.size_bytes for side in (telegram.a, telegram.b) if side)
        assert covered == list(range(longest))
