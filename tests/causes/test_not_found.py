"""Readers that are gone for so long that their senders look for them by ARP, and send nothing meanwhile."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.causes.cause import Cause
from nvscope.simulate.scenario_file import read_scenario
from tests.causes.told import causes_of
from tests.simulate.simulation import Simulation

PLANT = """
title = "a reader without its cable"
duration = "150s"

[[node]]
name = "press"
address = "10.0.0.1"
[[node]]
name = "saw"
address = "10.0.0.2"
[[node]]
name = "drill"
address = "10.0.0.3"

[[list]]
name = "axis"
index = 1
sender = "press"
destination = "10.0.0.2"
bytes = [88]
interval = "100ms"
{acknowledge}
[[list]]
name = "depth"
index = 4
sender = "drill"
bytes = [40]
interval = "50ms"
{reader}

[[unplugged]]
node = "saw"
at = "20s"
until = "100s"
"""
ANSWERED = {"acknowledge": "acknowledge = true", "reader": '[[reader]]\nnode = "saw"\nlist = "axis"'}
UNANSWERED = {"acknowledge": "", "reader": ""}
HELD_BACK = '[[loss]]\nlist = "axis"\nfrom = "55s"\nuntil = "100.5s"\n'
ASKS = '[[traffic]]\nkind = "arp"\nnode = "press"\nto = "saw"\ninterval = "1s"\nfrom = "{}"\nuntil = "{}"\n'
ANSWERS = '[[traffic]]\nkind = "arp"\nnode = "saw"\nto = "press"\ninterval = "1s"\nfrom = "50.1s"\nuntil = "101s"\n'
BESIDE = '[[list]]\nname = "state"\nindex = 7\nsender = "press"\nbytes = [8]\ninterval = "200ms"\n'


def told(text: str, directory: Path) -> list[Cause]:
    return list(causes_of(Simulation(read_scenario(text)).inquiry(directory))[1])


def seconds(cause: Cause) -> tuple[float | None, float | None]:
    start_ns = 1_704_067_200_000_000_000
    times = (None if time is None else round((time - start_ns) / 1e9, 1) for time in (cause.since_ns, cause.until_ns))
    since_s, until_s = times
    return since_s, until_s


def test_what_a_sender_holds_back_is_the_silence_of_its_reader(tmp_path: Path) -> None:
    (cause,) = told(PLANT.format(**ANSWERED) + HELD_BACK + ASKS.format("50s", "101s"), tmp_path)
    assert (cause.kind.name, seconds(cause)) == ("reader-silent", (20.0, 100.5))
    assert cause.title == "Node 10.0.0.2 did not answer for list 1 from 20.0 s to 100.5 s"
    assert "10.0.0.1 asks for its address in vain (ARP): it cannot send list 1 from 54.9 s to 100.5 s" in cause.checked


@pytest.mark.parametrize("how", [ANSWERED, UNANSWERED])
def test_it_is_so_until_the_list_comes_again(how: dict[str, str], tmp_path: Path) -> None:
    text = PLANT.format(**how).replace('"150s"', '"90s"').replace('until = "100s"\n', "")
    (cause,) = told(text + HELD_BACK.replace("100.5s", "90s") + ASKS.format("50s", "90s"), tmp_path)
    assert (cause.kind.name in ("reader-silent", "reader-not-found"), cause.until_ns) == (True, None)


@pytest.mark.parametrize("also", ["", BESIDE])
def test_so_it_is_where_nobody_waits_for_answers(also: str, tmp_path: Path) -> None:
    (cause,) = told(PLANT.format(**UNANSWERED) + also + HELD_BACK + ASKS.format("50s", "101s"), tmp_path)
    assert (cause.kind.name, seconds(cause)) == ("reader-not-found", (54.9, 100.5))
    assert cause.title == "Node 10.0.0.1 did not find node 10.0.0.2 from 54.9 s to 100.5 s, which alone reads list 1"


@pytest.mark.parametrize(
    ("what", "kind", "asked"),
    [
        ("nobody asks", "node-silent", ""),
        ("it asks before, and no more then", "program-stopped", ASKS.format("50s", "70s")),
        ("it asks when all is over nearly", "program-stopped", ASKS.format("90s", "101s")),
        ("who is asked for answers", "program-stopped", ASKS.format("50s", "101s") + ANSWERS),
    ],
)
def test_else_it_is_the_sender(what: str, kind: str, asked: str, tmp_path: Path) -> None:
    plant = PLANT.format(**UNANSWERED).partition("[[unplugged]]")[0]
    (cause,) = told(plant + HELD_BACK + asked, tmp_path)
    assert (cause.kind.name, cause.nodes and seconds(cause)) == (kind, (54.9, 100.5)), what


def test_a_list_for_everybody_is_not_held_back(tmp_path: Path) -> None:
    text = PLANT.format(**UNANSWERED).replace('destination = "10.0.0.2"\n', "")
    (cause,) = told(text + HELD_BACK + ASKS.format("50s", "101s"), tmp_path)
    assert cause.kind.name == "program-stopped"
