"""Restarts whose first telegrams nobody saw, beside copies that come late."""

from __future__ import annotations

from pathlib import Path

from nvscope.causes.cause import Cause
from nvscope.simulate.scenario_file import read_scenario
from tests.causes.told import causes_of
from tests.simulate.simulation import Simulation

PLANT = """
title = "a node whose port forwards late after a restart"
duration = "70s"
wild = true

[[node]]
name = "press"
address = "10.0.0.1"
first_value = 1
[[node]]
name = "saw"
address = "10.0.0.2"

[[list]]
name = "axis"
index = 1
sender = "press"
bytes = [88]
interval = "500ms"
[[list]]
name = "recipe"
index = 2
sender = "press"
bytes = [40]
interval = "1s"
[[list]]
name = "blade"
index = 3
sender = "saw"
bytes = [40]
interval = "100ms"
"""
RESTART = '[[restart]]\nnode = "press"\nat = "28s"\noutage = "4s"\n'


def lost(since: str, until: str) -> str:
    return "".join(f'[[loss]]\nlist = "{name}"\nfrom = "{since}"\nuntil = "{until}"\n' for name in ("axis", "recipe"))


def told(text: str, directory: Path) -> list[Cause]:
    return list(causes_of(Simulation(read_scenario(text)).inquiry(directory))[1])


def test_a_counter_that_comes_back_lower_began_anew(tmp_path: Path) -> None:
    (cause,) = told(PLANT + RESTART + lost("28s", "38s"), tmp_path)
    assert (cause.kind.name, cause.title) == ("node-restart", "Node 10.0.0.1 started anew at 38.0 s")
    assert "came back lower, and count on from there" in cause.checked[0]
    assert cause.checked[1].startswith("it sent nothing for 10.5 s;")


def test_a_cable_that_was_out_for_so_long_is_none(tmp_path: Path) -> None:
    (cause,) = told(PLANT + lost("28s", "38s"), tmp_path)
    assert cause.kind.name == "node-silent"


def test_copies_of_single_telegrams_are_none(tmp_path: Path) -> None:
    text = PLANT + '[[duplicate]]\nlist = "axis"\ntelegrams = [20, 30, 40, 50]\nbehind = 3\n'
    assert "node-restart" not in {cause.kind.name for cause in told(text, tmp_path)}
