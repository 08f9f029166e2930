"""Captures of scenarios that tests change a little: by text, and with another seed."""

from __future__ import annotations

import re
from pathlib import Path

from nvscope.simulate.scenario_file import load_scenario
from tests.simulate.simulation import Simulation

SCENARIOS = Path(__file__).parents[1] / "scenarios"


def capture_of(name: str, folder: Path, *changes: tuple[str, str], seed: int = 1, more: str = "") -> Path:
    """Write the capture of a scenario, in which each first text of ``changes`` gives way to the second.

    It has another name for each seed; ``more`` is put behind its text.
    """
    text = re.sub(r"(?m)^seed *=.*\n", "", (SCENARIOS / f"{name}.toml").read_text(encoding="utf-8"))
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    scenario = folder / f"{name}-{seed}.toml"
    scenario.write_text(f"seed = {seed}\n{text}\n{more}", encoding="utf-8")
    return Simulation(load_scenario(scenario)).write(folder / f"{name}-{seed}.pcapng")
