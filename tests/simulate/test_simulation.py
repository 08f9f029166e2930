"""What tests share of a scenario is what the simulator makes of it, and stays so."""

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
    assert Path(path).read_bytes() == simulation.write(tmp_path / "shared.pcapng").read_bytes()


def test_nobody_changes_it_for_others() -> None:
    simulation = simulated(SCENARIOS / "loss.toml")
    for batch in simulation.batches:
        for column in (batch.data, batch.ts_ns, batch.captured, batch.offset, batch.original):
            with pytest.raises(ValueError, match="read-only"):
                column[:] = 0
    simulation.truth["lists"].clear()
    simulation.findings.clear()
    assert simulation.truth["lists"]
    assert simulation.findings
    assert simulated(SCENARIOS / "loss.toml") is simulation
