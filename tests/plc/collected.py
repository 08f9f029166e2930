"""Collected: a sink that keeps what it is given, and gives it back as single frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dissectors.batch import PacketBatch
from nvscope.definition.load import load_definitions
from nvscope.definition.model import Definition
from nvscope.plc.can_definition import can_definitions
from nvscope.plc.scenario import Scenario
from nvscope.plc.simulator import simulate
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
        for batch in self.batches:
            for row in range(len(batch)):
                yield Frame(int(batch.ts_ns[row]), int(batch.link[row]), batch.packet(row), int(batch.original[row]))


def run(scenario: Scenario) -> tuple[dict[str, Any], list[Frame]]:
    """Return the truth about a scenario and its frames."""
    sink = Collected()
    truth = simulate(scenario, sink)
    return truth, list(sink.frames())


def definition_of(scenario: Scenario) -> Definition | None:
    """Return the definition of a scenario's lists on CAN as read from files, None where there are no such lists."""
    texts = can_definitions(scenario)
    if not texts:
        return None
    with TemporaryDirectory() as directory:
        paths = [Path(directory) / f"{name}.gvl" for name in texts]
        for path, text in zip(paths, texts.values(), strict=True):
            path.write_text(text, encoding="utf-8")
        return load_definitions([str(path) for path in paths])
