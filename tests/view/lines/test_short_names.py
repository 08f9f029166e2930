"""Names with too little room: short ones stay as they are, long ones stay different."""

from __future__ import annotations

import re

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nvscope.view.escape import visible
from nvscope.view.lines.short_names import bare_width, short_address, short_names
from nvscope.view.lines.text_width import display_width

STATIONS = [f"GVL_NetVars_Conveyor_Station{number:02}_Send" for number in (1, 2, 13)]
PARTS = st.sampled_from(["GVL", "_", "Station", "station", "1", "02", "13", ".", "Send", "値", "e\u0301", "x", "-"])
ESCAPE = re.compile(r"\\(?:x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8}|.)")
NAMES = st.lists(PARTS, min_size=1, max_size=12).map("".join) | st.text(max_size=30).map(visible).filter(bool)


@pytest.mark.parametrize(
    ("names", "width", "shown"),
    [
        (STATIONS, 40, STATIONS),
        (STATIONS, 15, ["…Station01_Send", "…Station02_Send", "…Station13_Send"]),
        (STATIONS, 11, ["…Station01…", "…Station02…", "…Station13…"]),
        (STATIONS, 4, ["…01…", "…02…", "…13…"]),
        (["Motor.left.speed", "Motor.right.speed"], 13, ["…left.speed", "…right.speed"]),
        (["Motor.left.speed", "Motor.right.speed"], 8, ["…left…", "…right…"]),
        (["press", "a-name-without-anything-in-common"], 16, ["press", "a-name-w…-common"]),
        (["axis1", "axis12"], 5, ["…1", "…12"]),
        (["axis12_x", "axis1_x", "axis13_x"], 7, ["axis12…", "axis1…", "axis13…"]),
        (["can0/0x18FF0010", "can0/0x18FE0020"], 11, ["…0x18FF0010", "…0x18FE0020"]),
        (["fd00::1a2b:10", "fd00::1a3c:10"], 10, ["…1a2b:10", "…1a3c:10"]),
        (["02:00:1a:01", "02:00:1b:02"], 7, ["…1a:01", "…1b:02"]),
        (["Arp.Plc.Eclr/values[1]", "Arp.Plc.Eclr/values[12]"], 14, ["…values[1]", "…values[12]"]),
        (["Arp.Plc.Eclr/a[1]", "Arp.Plc.Eclr/b[1]"], 8, ["…a[1]", "…b[1]"]),
        (["axis12345-of-the-press", "conveyor"], 12, ["axis…e-press", "conveyor"]),
        (["10.20.30.101", "10.20.30.7"], 8, ["…101", "…7"]),
        (["a-name-that-stands-alone"], 11, ["a-nam…alone"]),
    ],
)
def test_what_all_have_in_common_goes_first(names: list[str], width: int, shown: list[str]) -> None:
    assert [short_names(names, width)[name] for name in names] == shown


@given(st.sets(NAMES, min_size=1, max_size=30), st.integers(8, 50))
def test_forms_fit_and_those_of_different_names_differ(names: set[str], width: int) -> None:
    forms = short_names(names, width)
    assert forms.keys() == names
    assert all(display_width(form) <= width for form in forms.values())
    # Of an escape nothing is left where there is no room for all of it.
    if any(display_width(escape) >= width - 1 for name in names for escape in ESCAPE.findall(name)):
        return
    # What a terminal cannot show apart, such as a mark beyond the width, need not differ.
    assert len(set(forms.values())) == len(names)
    if all(display_width(name) <= width for name in names):
        assert all(form == name for name, form in forms.items())


@given(st.sets(NAMES, min_size=2, max_size=10), NAMES, NAMES)
def test_a_common_beginning_and_end_go_before_any_middle(middles: set[str], before: str, behind: str) -> None:
    names = {f"{before}_{middle}_{behind}" for middle in middles}
    width = bare_width(names)
    assume(width >= 8)
    for name, form in short_names(names, width).items():
        assert form.strip("…") in name
        assert "…" not in form.strip("…") or "…" in name


@given(st.sets(NAMES, min_size=1, max_size=30), st.integers(1, 7))
def test_where_there_is_no_room_forms_fit_all_the_same(names: set[str], width: int) -> None:
    assert all(display_width(form) <= width for form in short_names(names, width).values())


def test_ten_thousand_names_are_told_apart() -> None:
    names = [f"{'x' * 20}{number:05}{'y' * (number % 7)}{'z' * 20}" for number in range(10_000)]
    assert len(set(short_names(names, 12).values())) == len(names)


def test_where_no_way_of_cutting_tells_names_apart_they_have_numbers() -> None:
    alike = [f"{'a' * 10}{first}{'b' * 10}{second}{'c' * 10}" for first in "12" for second in "12"]
    forms = short_names([*alike, "q" * 40], 10)
    assert [forms[name] for name in alike] == ["aaaaa…cccc", "aa…ccccccc", "aaaaaaa…cc", "aaaaaaaa…2"]


@pytest.mark.parametrize(
    ("address", "width", "told"),
    [
        ("192.168.100.12", 9, "192.….12"),
        ("192.168.1.12", 5, "…1.12"),
        ("02:00:00:00:00:0a", 9, "02:…00:0a"),
        ("broadcast", 6, "broad…"),
        ("10.0.0.1", 8, "10.0.0.1"),
    ],
)
def test_addresses_are_cut_between_their_numbers(address: str, width: int, told: str) -> None:
    assert short_address(address, width) == told
