"""Which lists a name, an identifier or a key chooses, in any case of letters."""

from __future__ import annotations

import pytest

from nvscope.definition.layouts import Layouts
from nvscope.definition.model import Definition
from nvscope.definition.selection import keys_named, lists_named, select
from nvscope.definition.variables import Array, Member, Structure
from nvscope.errors import UsageError
from nvscope.list_key import ListKey
from tests.definition.lists import INT, list_of
from tests.records import replace

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


AXIS = Structure("Axis", (Member("pos", INT), Member("vel", INT)))
DRIVE = replace(list_of([AXIS, Array(((0, 3),), INT)], list_id=8), name="drive")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("drive:pos", "near it: v0.pos"),
        ("drive/v0/pos", "near it: v0.pos"),
        ("GVL.drive.v0.pos", "near it: v0.pos"),
        ("drive.v1[2]", "near it: v1[2], v1[3], v1[1]"),
        # In front of a colon stands a list: here it is a variable, or there is none like it.
        ("v0:pos", "near it: v0.pos; there are Axis (udp/1202/7), drive (udp/1202/8)"),
        ("drve:vel", "near it: v0.vel; there are Axis (udp/1202/7), drive (udp/1202/8)"),
        ("drve:ves", "there are Axis (udp/1202/7), drive (udp/1202/8)"),
    ],
)
def test_what_was_perhaps_meant_is_told(name: str, said: str) -> None:
    with pytest.raises(UsageError) as error:
        select(Layouts(Definition((UDP, DRIVE))), name)
    assert error.value.next_step == said


def test_of_many_lists_the_near_ones_are_told_first() -> None:
    lists = [(ListKey.udp(1202, number), f"line{number}") for number in range(20)] + [(ListKey.udp(1202, 99), "press")]
    with pytest.raises(UsageError) as error:
        keys_named(lists, "pres")
    assert str(error.value.next_step).startswith("near it: press (udp/1202/99); there are line0 (udp/1202/0), ")
