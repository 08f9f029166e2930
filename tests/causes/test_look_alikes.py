"""Faults that look alike: what tells them apart is what was checked."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.simulate.scenario_file import read_scenario
from tests.causes.told import causes_of
from tests.simulate.simulation import Simulation

PLANT = """
title = "three controllers"
duration = "60s"

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
bytes = [88]
interval = "50ms"
[[list]]
name = "recipe"
index = 2
sender = "press"
bytes = [256, 40]
interval = "100ms"
[[list]]
name = "blade"
index = 3
sender = "saw"
bytes = [40]
interval = "50ms"
[[list]]
name = "depth"
index = 4
sender = "drill"
bytes = [40]
interval = "50ms"
"""
ALIVE = '[[traffic]]\nkind = "arp"\nnode = "press"\nto = "saw"\ninterval = "700ms"\n'
OF_PRESS, ALL = ("axis", "recipe"), ("axis", "recipe", "blade", "depth")


def held_up(*lists: str) -> str:
    return "".join(f'[[pause]]\nlist = "{name}"\nat = "15s"\nby = "6s"\n' for name in lists)


def cut_off(*lists: str) -> str:
    return "".join(f'[[loss]]\nlist = "{name}"\nfrom = "15s"\nuntil = "21s"\n' for name in lists)


def lossy(*lists: str) -> str:
    return "".join(f'[[loss]]\nlist = "{name}"\nprobability = 0.04\n' for name in lists)


CASES = {
    "its program stood still": (
        held_up(*OF_PRESS) + ALIVE, "program-stopped", "Node 10.0.0.1 sent none of its lists from 15.0 s to 21.0 s",
        ["other frames of it (ARP, ICMP, TCP …) go on: it has power and cable", "2 other nodes go on",
         "its counters stood still meanwhile: it did not send"],
    ),
    "it was without power": (
        held_up(*OF_PRESS), "node-silent", "Node 10.0.0.1 was silent from 15.0 s to 21.0 s",
        ["its counters stood still meanwhile: it did not send"],
    ),
    "its cable was out": (
        cut_off(*OF_PRESS), "node-silent", "Node 10.0.0.1 was silent from 15.0 s to 21.0 s",
        ["its counters went on meanwhile: its program ran, cable or switch port did not"],
    ),
    "its link loses": (
        lossy(*OF_PRESS), "loss-at-sender", "Node 10.0.0.1 lost", ["no other sender lost any then"],
    ),
    "the mirror port loses": (
        lossy(*ALL), "capture-incomplete", "The capture lacks",
        ["all lists of several senders lose about the same share"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_looks_alike_is_told_apart(name: str, tmp_path: Path) -> None:
    faults, kind, title, checked = CASES[name]
    _, (cause,) = causes_of(Simulation(read_scenario(PLANT + faults)).inquiry(tmp_path))
    assert cause.kind.name == kind
    assert cause.title.startswith(title)
    assert set(checked) <= set(cause.checked)


STOPPED = '[[stop]]\nnode = "press"\nlist = "recipe"\nat = "{}"\n'
LATER = '[[list]]\nname = "log"\nindex = 9\nsender = "press"\nbytes = [8]\ninterval = "100ms"\nfrom = "40s"\n'


@pytest.mark.parametrize(("also", "further"), [(LATER, []), (STOPPED.format("13s"), ["list-stopped"])])
def test_a_list_that_begins_later_or_ended_before_changes_nothing_of_a_silence(
    also: str, further: list[str], tmp_path: Path
) -> None:
    fault = cut_off("axis") if "stop" in also else cut_off(*OF_PRESS)
    _, causes = causes_of(Simulation(read_scenario(PLANT + fault + also)).inquiry(tmp_path))
    (silent,) = (cause for cause in causes if cause.kind.name == "node-silent")
    assert silent.title.startswith("Node 10.0.0.1 was silent from 15.0 s to 21.0 s (list")
    assert "9" not in silent.title
    assert sorted(cause.kind.name for cause in causes if cause is not silent) == further


@pytest.mark.parametrize(("answers", "caveat"), [(False, True), (True, False)])
def test_what_is_for_one_station_may_be_kept_from_a_capture(answers: bool, caveat: bool, tmp_path: Path) -> None:
    """Acknowledgements are for one station, too: where they are seen, a switch keeps nothing back."""
    text = PLANT.replace('sender = "press"\n', 'sender = "press"\ndestination = "saw"\n')
    if answers:
        text = text.replace('destination = "saw"\n', 'destination = "saw"\nacknowledge = true\n')
        text += "".join(f'[[reader]]\nnode = "saw"\nlist = "{name}"\n' for name in OF_PRESS)
    text += '[[power_off]]\nnode = "press"\nat = "20s"\n'
    _, (cause,) = causes_of(Simulation(read_scenario(text)).inquiry(tmp_path))
    assert cause.kind.name == "node-silent"
    assert cause.next.startswith("Whether a mirror port shows it") == caveat


def test_a_program_that_is_gone_is_told_by_its_port_too(tmp_path: Path) -> None:
    text = PLANT.replace('sender = "saw"\n', 'sender = "saw"\ndestination = "press"\n')
    text += "".join(f'[[stop]]\nnode = "press"\nlist = "{name}"\nat = "20s"\n' for name in OF_PRESS) + ALIVE
    text += '[[unreachable]]\nlist = "blade"\nfrom = "20s"\n'
    _, causes = causes_of(Simulation(read_scenario(text)).inquiry(tmp_path))
    (stopped,) = (cause for cause in causes if cause.kind.name == "program-stopped")
    assert stopped.checked[0] == "it says itself that no program listens at its port (ICMP)"
