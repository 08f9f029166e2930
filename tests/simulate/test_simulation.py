"""What tests take for a simulation is what the simulator makes of the scenario."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.simulate.simulator import open_capture, simulate
from tests.simulate.simulation import simulated

SCENARIOS = Path(__file__).parent.parent / "scenarios"


@pytest.mark.parametrize("name", ["plant-clean", "wild", "can-two-channels", "can-and-ethernet"])
def test_it_is_what_the_simulator_tells_and_writes(name: str, tmp_path: Path) -> None:
    simulation = simulated(SCENARIOS / f"{name}.toml")
    path = str(tmp_path / "simulated.pcapng")
    with open_capture(simulation.scenario, path, path) as sink:
        assert simulate(simulation.scenario, sink) == simulation.truth
    assert Path(path).read_bytes() == simulation.write(tmp_path / "again.pcapng").read_bytes()
