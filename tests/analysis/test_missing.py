"""What of the defined lists does not arrive, as reports and the variables of a capture tell it."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.analysis.missing import missing_of_lists
from nvscope.definition.model import Definition, ListDefinition
from nvscope.definition.project import Project
from nvscope.definition.variables import Array, Member, Structure
from tests.causes.test_definitions_elsewhere import POWER, SPEED, sent
from tests.causes.test_foreign_headers import short_header
from tests.definition.lists import BOOL, INT, REAL, list_of
from tests.oracle.builders import data_frame, link_frame, telegram, unreachable, whole
from tests.oracle.frame import Frame
from tests.oracle.pcap import write_pcap
from tests.records import replace

MS = 1_000_000
READER = ip_address("10.0.0.9")

Rows = list[dict[str, Any]]


class Asked:
    """Captured frames, and how both verbs tell what is missing."""

    def __init__(self, frames: Sequence[Frame], lists: Sequence[ListDefinition], directory: Path) -> None:
        path = directory / "frames.pcap"
        write_pcap(sorted(frames, key=lambda one: one.ts_ns), path)
        self.inquiry = Inquiry([str(path)], Project(definition=Definition(tuple(lists)), ports=(1202, 1203)))

    def report(self, expression: str | None = None, listed: Sequence[str] = ()) -> Rows:
        found = self.inquiry.analyze(expression, values=True)
        rows: Rows = self.inquiry.report(found, listed=listed)["missing"]
        return rows

    def variables(self) -> Rows:
        found = self.inquiry.analyze(values=True, causes=False)
        return missing_of_lists(found, self.inquiry.project, None, {})


def absent(rows: Rows) -> Rows:
    """Return rows about lists as wholes: the telegrams of ``sent`` change in their first variable only."""
    return [row for row in rows if row["kind"] != "never-changed"]


def told(rows: Rows) -> list[tuple[str, str | None, str]]:
    return [(row["what"], row["why"], row["next"]) for row in rows]


@pytest.mark.parametrize(
    ("frames", "why", "step"),
    [
        (sent(SPEED, 7), "10.0.0.1 sends it as list 7",
         "Set the list identifier to 7 in the definition, or to 12 in the sender."),
        (sent(SPEED, 12, 1203), "10.0.0.1 sends it on port 1203",
         "Set the port to 1203 in the definition, or to 1202 in the sender."),
        (sent(replace(SPEED, pack=False), 7), "10.0.0.1 sends it as list 7 and not packed",
         "Set the list identifier to 7 in the definition, or to 12 in the sender. Set Pack to FALSE in the definition "
         "and in the readers."),
    ],
    ids=["identifier", "port", "packing"],
)  # fmt: skip
def test_a_list_that_never_came_has_the_one_that_fits_it(
    frames: Sequence[Frame], why: str, step: str, tmp_path: Path
) -> None:
    asked = Asked([*frames, *sent(POWER, 13)], [SPEED, POWER], tmp_path)
    name = "Speed (1202/12)" if "port" in why else "Speed (12)"
    for rows in (asked.report(), asked.variables()):
        row = next(row for row in rows if row["kind"] == "never-seen")
        assert told([row]) == [(f"{name} was never seen", why, step)]
        assert row["lists"][0] == "udp/1202/12"
        assert row["nodes"] == ["10.0.0.1"]


def test_a_list_that_nothing_fits_is_missing_all_the_same(tmp_path: Path) -> None:
    (row,) = absent(Asked(sent(POWER, 13), [SPEED, POWER], tmp_path).variables())
    step = "Check in the sender that the task of the list runs; change a variable by hand and look again."
    assert told([row]) == [("Speed (12) was never seen", None, step)]
    rows = Asked([*sent(POWER, 13), *sent(list_of([INT, INT, INT]), 14)], [SPEED, POWER], tmp_path).variables()
    assert rows[0]["why"] == "no list without a definition has its shape"


def test_nothing_is_missing_where_all_came(tmp_path: Path) -> None:
    asked = Asked([*sent(SPEED, 12), *sent(POWER, 13)], [SPEED, POWER], tmp_path)
    assert absent(asked.report()) == absent(asked.variables()) == []


def test_without_definitions_nothing_is_said(tmp_path: Path) -> None:
    asked = Asked(sent(SPEED, 12), [], tmp_path)
    assert "missing" not in asked.inquiry.report(asked.inquiry.analyze())


def test_what_was_not_asked_for_is_not_missing(tmp_path: Path) -> None:
    asked = Asked([*sent(SPEED, 7), *sent(POWER, 13)], [SPEED, POWER], tmp_path)
    assert absent(asked.report(listed=["Power"])) == []
    assert [row["why"] for row in asked.report(listed=["Speed"])] == ["10.0.0.1 sends it as list 7"]
    assert asked.report("nv.index == 13") == []


def test_headers_that_no_controller_can_read(tmp_path: Path) -> None:
    payloads = [short_header(number + 1, bytes([number, 0])) for number in range(30)]
    frames = [data_frame(number * 100 * MS, "10.0.0.1", "255.255.255.255", one) for number, one in enumerate(payloads)]
    defined = replace(list_of([INT]), list_id=9, name="Level")
    asked = Asked([*frames, *sent(POWER, 13)], [defined, POWER], tmp_path)
    for rows in (asked.report(), asked.variables()):
        (row,) = absent(rows)
        assert row["kind"] == "header-foreign"
        assert row["what"] == "No controller can read Level (9) of 10.0.0.1"
        assert row["why"].startswith("a header of 18 bytes in place of 20 would fit")
    # Variables of others are not asked for.
    assert absent(Asked([*frames, *sent(POWER, 13)], [POWER], tmp_path).variables()) == []


def returned(number: int) -> Frame:
    """Return a message that nobody listens for list 13 at the reader."""
    quoted = data_frame(0, "10.0.0.1", str(READER), telegram(list_id=13, items=2, data=bytes(4))).data[14:]
    return whole(number * 1_000 * MS + 2 * MS, 1, link_frame(unreachable(READER, quoted)))


def test_a_reader_without_a_program_is_missing_as_long_as_it_has_none(tmp_path: Path) -> None:
    data = [struct.pack("<hh", number, number) for number in range(60)]
    frames = [
        data_frame(number * 100 * MS, "10.0.0.1", str(READER), telegram(list_id=13, items=2, counter=number + 1,
                                                                       data=one))
        for number, one in enumerate(data)
    ]  # fmt: skip
    asked = Asked([*frames, *map(returned, range(6))], [POWER], tmp_path)
    (row,) = asked.report()
    assert (row["kind"], row["nodes"]) == ("reader-without-program", ["10.0.0.9"])
    assert row["what"].startswith("Node 10.0.0.9 has no program at port 1202")
    (row,) = asked.variables()
    assert row["what"] == "A reader does not get Power (13) of 10.0.0.1"
    assert row["why"] == "nobody listens there, or there is no way to it, as ICMP says, 6 times"
    over = Asked([*frames, returned(0), returned(1)], [POWER], tmp_path)
    assert over.report() == over.variables() == []


AXIS = Structure("Axis", (Member("pos", INT), Member("on", BOOL)))
PLANT = replace(
    list_of([INT, BOOL, Array(((0, 3),), INT), Array(((0, 1),), AXIS), AXIS, Array(((1, 2),), REAL)], list_id=12),
    name="Plant",
)


def plant(telegrams: int, *, moves: bool = True) -> list[Frame]:
    """Return telegrams in which ``v0``, one element of ``v2``, and ``pos`` of one axis in ``v3`` change."""
    frames = []
    for number in range(telegrams):
        step = number if moves else 0
        data = struct.pack("<hB4h hBhB hB 2f", step, 1, 5, 5, step, 5, 9, 1, step, 1, 3, 0, 1.5, 2.5)
        payload = telegram(list_id=12, items=14, counter=number + 1, data=data)
        frames.append(data_frame(number * 100 * MS, "10.0.0.1", "255.255.255.255", payload))
    return frames


def test_what_never_changes_is_told_with_arrays_and_structures_as_one(tmp_path: Path) -> None:
    asked = Asked(plant(20), [PLANT], tmp_path)
    for rows in (asked.report(), asked.variables()):
        (row,) = rows
        assert (row["kind"], row["severity"]) == ("never-changed", "note")
        assert row["variables"] == ["v1", "v3[*].on", "v4", "v5"]
        assert row["what"] == "4 variables of Plant (12) never changed in 20 telegrams, others of it did"


def test_variables_of_which_too_little_came_or_none_changed_are_no_matter(tmp_path: Path) -> None:
    assert Asked(plant(9), [PLANT], tmp_path).report() == []
    assert Asked(plant(20, moves=False), [PLANT], tmp_path).report() == []
    assert Asked(plant(20), [PLANT], tmp_path).report("frame.number > 5") == []


def test_only_the_first_of_many_variables_are_named(tmp_path: Path) -> None:
    many = replace(list_of([INT] * 15), list_id=12, name="Many")
    frames = [
        data_frame(number * 100 * MS, "10.0.0.1", "255.255.255.255",
                   telegram(list_id=12, items=15, counter=number + 1, data=struct.pack("<h28x", number)))
        for number in range(20)
    ]  # fmt: skip
    (row,) = Asked(frames, [many], tmp_path).variables()
    assert (row["variables"][0], len(row["variables"]), row["variables_cut"]) == ("v1", 10, 4)
