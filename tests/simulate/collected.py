"""Collected: a sink that keeps what it is given, and gives it back as single frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from dissectors.batch import PacketBatch
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.simulator import simulate
from tests.oracle.frame import Frame


class Collected:
    """All batches that were written."""

    def __init__(self) -> None:
        self.batches: list[PacketBatch] = []

    def write(self, batch: PacketBatch) -> None:
        self.batches.append(batch)

    def close(self) -> None:
        pass

    def frames(self) -> Iterator[Frame]:
        return frames_of(self.batches)


def frames_of(batches: Iterable[PacketBatch]) -> Iterator[Frame]:
    """Yield the packets of batches as single frames."""
    for batch in batches:
        for row in range(len(batch)):
            yield Frame(int(batch.ts_ns[row]), int(batch.link[row]), batch.packet(row), int(batch.original[row]))


def run(scenario: Scenario) -> tuple[dict[str, Any], list[Frame]]:
    """Return the truth about a scenario and its frames."""
    sink = Collected()
    truth = simulate(scenario, sink)
    return truth, list(sink.frames())
