"""How often what was put into plants is told, and nothing else: precision and recall by kind of cause."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from nvscope.analysis.causes import causes_of
from nvscope.causes.cause import Cause
from nvscope.findings.kind import Severity
from nvscope.simulate.scenario_file import read_scenario
from nvscope.tracker.summary import Summary
from tests.causes.drawn_plants import Fault, Plant, drawn_plant
from tests.laws import share_of
from tests.simulate.simulation import Simulation

PLANTS = 250
LEAST = 0.98
"""Of what is put in and of what is told, each kind (causes.md, section 5)."""


class Score:
    """What was put in, found and told without reason, by kind."""

    def __init__(self) -> None:
        self.put: Counter[str] = Counter()
        self.found: Counter[str] = Counter()
        self.told: Counter[str] = Counter()
        self.wrong: list[str] = []

    def count(self, seed: int, plant: Plant, summary: Summary, causes: list[Cause]) -> None:
        left = [cause for cause in causes if cause.severity > Severity.NOTE]
        self.told.update(cause.kind.name for cause in left)
        for fault in plant.faults:
            kind = fault.kinds[0]
            self.put[kind] += 1
            fitting = [cause for cause in left if is_told(fault, plant, summary, cause)]
            if fitting:
                self.found[kind] += 1
                left.remove(fitting[0])
            else:
                self.wrong.append(f"plant {seed}: {fault} is not told")
        self.wrong += [f"plant {seed}: nothing was put in for {cause.kind.name}: {cause.title}" for cause in left]

    def table(self) -> str:
        """Return recall and precision of each kind, for people."""
        rows = [f"{'kind':24} put in  recall  precision"]
        for kind in sorted({*self.put, *self.told}):
            recall, precision = self.recall(kind), self.precision(kind)
            rows.append(f"{kind:24} {self.put[kind]:6}  {recall:6.3f}  {precision:9.3f}")
        return "\n".join([*rows, *self.wrong])

    def recall(self, kind: str) -> float:
        return self.found[kind] / self.put[kind] if self.put[kind] else 1.0

    def precision(self, kind: str) -> float:
        return self.found[kind] / self.told[kind] if self.told[kind] else 1.0


def is_told(fault: Fault, plant: Plant, summary: Summary, cause: Cause) -> bool:
    """Tell whether a cause is that of a fault: its kind, its node and list, and since when."""
    assert summary.start_ns is not None
    index = next((one.index for one in plant.lists if one.name == fault.list), None)
    longest_s = max(one.interval_ms for one in plant.lists) / 1000
    assert cause.since_ns is not None
    return (
        cause.kind.name in fault.kinds
        and plant.addresses[fault.node] in {summary.addresses[node] for node in cause.nodes}
        and (index is None or index in {key.identifier for key in cause.lists})
        and abs((cause.since_ns - summary.start_ns) / 1e9 - fault.since_s) <= max(1.5 * longest_s, 1.5) + _OUTAGE_S
    )


_OUTAGE_S = 5.0
"""A restart begins with the last telegram before it, which may be so long ago."""


@pytest.mark.long
def test_what_is_put_into_a_plant_is_told_and_nothing_else(tmp_path: Path) -> None:
    score = Score()
    for seed in range(share_of(PLANTS)):
        plant = drawn_plant(seed)
        simulation = Simulation(read_scenario("\n".join(plant.text)))
        folder = tmp_path / str(seed)
        folder.mkdir()
        score.count(seed, plant, *causes_of(simulation.inquiry(folder)))
    print(score.table())
    assert len(score.put) == 7
    for kind in {*score.put, *score.told}:
        assert score.recall(kind) >= LEAST, score.table()
        assert score.precision(kind) >= LEAST, score.table()
