"""Which lists a name, an identifier or a key chooses, in any case of letters."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nvscope.definition.selection import lists_named
from nvscope.errors import UsageError
from tests.definition.lists import INT, list_of

UDP = replace(list_of([INT], list_id=7), name="Axis")
NAMED = replace(list_of([INT], list_id=0x181), name="Press", protocol="CAN", channel="Line_A")
ANY = replace(list_of([INT], list_id=0x182), name="Any", protocol="CAN")
LISTS = [(entry.key, entry) for entry in (UDP, NAMED, ANY) if entry.key is not None]


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("axis", "Axis"), ("7", "Axis"), ("1202/7", "Axis"), ("UDP/1202/7", "Axis"),
        ("PRESS", "Press"), ("can/Line_A/385", "Press"), ("CAN/line_a/385", "Press"), ("0x181", "Press"),
        ("can/385", "Press"), ("can/*/386", "Any"), (" any ", "Any"),
    ],
)  # fmt: skip
def test_a_list_by_what_people_write(given: str, name: str) -> None:
    assert [entry.name for _, entry in lists_named(LISTS, given)] == [name]


def test_a_channel_of_a_list_that_is_defined_for_any_is_told() -> None:
    with pytest.raises(UsageError) as error:
        lists_named(LISTS, "can/Line_B/386")
    assert "-Y 'can.channel == \"Line_B\"'" in str(error.value.next_step)
    with pytest.raises(UsageError) as error:
        lists_named(LISTS, "can/Line_B/385")
    assert "-Y" not in str(error.value.next_step)
