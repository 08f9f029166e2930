"""Lists that are sent under another identifier, on another port, or packed otherwise than they are defined."""

from __future__ import annotations

from pathlib import Path

from tests.causes.defined_plants import sent, told
from tests.definition.lists import BOOL, INT, LREAL, REAL, list_of
from tests.records import replace

SPEED = replace(list_of([BOOL, INT, REAL, LREAL], list_id=12), name="Speed")
POWER = replace(list_of([INT, INT], list_id=13), name="Power")


def test_another_identifier(tmp_path: Path) -> None:
    (cause,) = told([*sent(SPEED, 7), *sent(POWER, 13)], SPEED, POWER, directory=tmp_path)
    assert cause.kind.name == "definition-elsewhere"
    assert cause.title == "List Speed (12) is sent as list 7 since 0.0 s"
    assert cause.next == "Set the list identifier to 7 in the definition, or to 12 in the sender."
    assert [str(key) for key in cause.lists] == ["udp/1202/7", "udp/1202/12"]
    assert cause.checked[0] == (
        "its definition has the items and sizes of the telegram of list 7 on port 1202, from 10.0.0.1"
    )
    assert sorted(finding.code for finding in cause.findings) == ["NV406", "NV407"]
    assert cause.until_ns is None


def test_another_port(tmp_path: Path) -> None:
    (cause,) = told([*sent(SPEED, 12, 1203), *sent(POWER, 13)], SPEED, POWER, directory=tmp_path)
    assert cause.title == "List Speed (12) is sent on port 1203 since 0.0 s"
    assert cause.next == "Set the port to 1203 in the definition, or to 1202 in the sender."


def test_another_packing_too(tmp_path: Path) -> None:
    (cause,) = told([*sent(replace(SPEED, pack=False), 7), *sent(POWER, 13)], SPEED, POWER, directory=tmp_path)
    assert cause.title == "List Speed (12) is sent as list 7 and not packed since 0.0 s"
    assert cause.next.endswith("Set Pack to FALSE in the definition and in the readers.")
    assert "all 4 telegrams" in cause.checked[0]


def test_two_lists_that_have_each_others_identifier_differ(tmp_path: Path) -> None:
    causes = told([*sent(SPEED, 13), *sent(POWER, 12)], SPEED, POWER, directory=tmp_path)
    assert {cause.kind.name for cause in causes} == {"definition-differs"}


def test_under_the_identifier_of_a_list_that_is_defined_otherwise(tmp_path: Path) -> None:
    (cause,) = told(sent(SPEED, 13), SPEED, POWER, directory=tmp_path)
    assert cause.title == "List Speed (12) is sent as list 13 since 0.0 s"
    assert sorted(finding.code for finding in cause.findings) == ["NV405", "NV407"]


def test_a_silent_list_and_an_unknown_one_of_another_shape_have_nothing_in_common(tmp_path: Path) -> None:
    other = list_of([INT, INT, INT, INT])
    causes = told([*sent(other, 7), *sent(POWER, 13)], SPEED, POWER, directory=tmp_path)
    assert {cause.kind.name for cause in causes} == {"other"}


def test_of_two_that_fit_the_one_with_the_same_identifier_is_meant(tmp_path: Path) -> None:
    (cause,) = told([*sent(SPEED, 7), *sent(SPEED, 12, 1203), *sent(POWER, 13)], SPEED, POWER, directory=tmp_path)
    assert cause.title == "List Speed (12) is sent on port 1203 since 0.0 s"
