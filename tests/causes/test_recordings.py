"""What the capture itself brings about: copies, frames that it cut, and moments in which it lacks frames of all."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.model import Definition
from nvscope.definition.project import Project
from nvscope.findings.kind import Severity
from tests.causes.plants import causes_in, frames_of, from_hardware
from tests.causes.told import causes_of
from tests.definition.lists import list_of
from tests.findings.defined import SENT
from tests.oracle.builders import data_frame, telegram
from tests.oracle.frame import Frame
from tests.records import replace

PLANT = """
title = "two controllers"
duration = "40s"
{settings}
[[node]]
name = "press"
address = "10.0.0.1"
[[node]]
name = "saw"
address = "10.0.0.2"
[[node]]
name = "hmi"
address = "10.0.0.50"

[[list]]
name = "axis"
index = 1
sender = "press"
bytes = [88]
interval = "100ms"
acknowledge = true
destination = "hmi"
[[reader]]
node = "hmi"
list = "axis"
delay = "3ms"
[[list]]
name = "blade"
index = 3
sender = "saw"
bytes = [40]
interval = "100ms"
"""
TWICE = '[[mirrored]]\nfrom = "10s"\nuntil = "16s"\n'
INTERFACES = Path(__file__).parents[2] / "captures" / "interfaces.pcapng"
SECOND_NS = 1_000_000_000


def plant(faults: str = "", settings: str = "") -> list[Frame]:
    return frames_of(PLANT.format(settings=settings) + faults)


def test_a_mirror_that_shows_all_twice_for_a_while(tmp_path: Path) -> None:
    (cause,) = causes_in(plant(TWICE), tmp_path)
    assert cause.kind.name == "mirrored-twice"
    assert cause.title == "The capture holds nearly every telegram twice, from 10.0 s to 15.9 s"
    assert cause.checked[0].startswith("120 telegrams came again, byte for byte, beside 1")
    assert cause.checked[1].startswith("addresses, VLAN and time to live are the same")
    assert {finding.code for finding in cause.findings} >= {"NV202"}


def test_a_slow_list_does_not_move_the_beginning_of_a_mirror_to_that_of_the_capture(tmp_path: Path) -> None:
    slow = '[[list]]\nname = "slow"\nindex = 4\nsender = "saw"\nbytes = [40]\ninterval = "6s"\n'
    frames = plant(slow + TWICE)
    (cause,) = causes_in(frames, tmp_path)
    assert cause.kind.name == "mirrored-twice"
    assert cause.since_ns is not None
    assert cause.since_ns - frames[0].ts_ns == pytest.approx(10 * SECOND_NS, abs=SECOND_NS)


def test_copies_of_a_list_whose_counter_stands_still_are_copies_too(tmp_path: Path) -> None:
    entry = replace(list_of(SENT, list_id=4), interval_ns=100_000_000)
    frames = plant("[[mirrored]]\n")
    still = telegram(list_id=4, items=4, counter=7, data=bytes(15))
    times_ns = [frames[0].ts_ns + at * 100_000_000 + at % 3 * 5_000_000 for at in range(400)]
    own = [data_frame(time_ns, "10.0.0.3", "255.255.255.255", still) for time_ns in times_ns]
    copies = [frame._replace(ts_ns=frame.ts_ns + 2_000) for frame in own]
    causes = causes_in([*frames, *own, *copies], tmp_path, Project(definition=Definition([entry])))
    assert [cause.kind.name for cause in causes if cause.severity > Severity.NOTE] == ["mirrored-twice"]


def test_a_router_seen_from_both_sides(tmp_path: Path) -> None:
    frames = plant()
    copies = [from_hardware(frame, "02:00:00:00:00:cc")._replace(ts_ns=frame.ts_ns + 40_000) for frame in frames]
    (cause,) = causes_in([*frames, *copies], tmp_path)
    assert cause.kind.name == "mirrored-twice"
    assert "hardware addresses 02:00:" in cause.checked[1]
    assert cause.checked[1].endswith("times to live 64 and 63: a router seen from both sides")
    assert cause.until_ns is None


def test_some_copies_here_and_there_are_no_mirror(tmp_path: Path) -> None:
    copies = '[[duplicate]]\nlist = "axis"\nevery = 10\n'
    assert "mirrored-twice" not in {cause.kind.name for cause in causes_in(plant(copies), tmp_path)}


def test_frames_that_a_snap_length_cut_are_one_note(tmp_path: Path) -> None:
    lost = '[[loss]]\nlist = "blade"\ntelegrams = [100]\n'
    note, loss = causes_in(plant(lost, "snap_length = 70"), tmp_path)
    assert loss.kind.name == "loss-of-list"
    assert (note.kind.name, note.severity) == ("capture-incomplete", Severity.NOTE)
    assert note.title.startswith("The capture holds only the beginning of ")
    assert {finding.code for finding in note.findings} == {"NV107"}


def test_drops_that_the_capture_tells_of_need_no_loss() -> None:
    causes = causes_of(Inquiry([str(INTERFACES)], Project()))[1]
    (cause,) = (one for one in causes if one.kind.name == "capture-incomplete")
    assert cause.title.startswith("The capture lacks frames: the capture lost 5 frames of its own")
    assert {finding.code for finding in cause.findings} == {"NV901"}


def flood(frames: list[Frame]) -> list[Frame]:
    """Return much else that came at 10 s and at 20 s."""
    start_ns = frames[0].ts_ns
    head = bytes.fromhex("020000000007020000000008") + b"\x88\xcc"
    return [
        Frame(start_ns + second * SECOND_NS + number * 1_000_000, 1, head + bytes(1400), 1414)
        for second in (10, 20) for number in range(-50, 50)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("with_flood", "told"), [(True, " of the usual bytes came then"), (False, "no more bytes came")]
)
def test_whether_more_came_in_the_moments_in_which_all_lose(with_flood: bool, told: str, tmp_path: Path) -> None:
    frames = plant()
    start_ns = frames[0].ts_ns
    kept = [
        frame for frame in frames
        if not any(0 <= frame.ts_ns - start_ns - second * SECOND_NS < 100_000_000 for second in (10, 20))
    ]  # fmt: skip
    causes = causes_in([*kept, *(flood(frames) if with_flood else ())], tmp_path)
    (cause,) = (one for one in causes if one.kind.name == "capture-incomplete")
    assert any(told in fact for fact in cause.checked)
