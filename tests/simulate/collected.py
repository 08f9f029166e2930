"""Collected: a sink that keeps what it is given, and gives it back as single frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dissectors.batch import PacketBatch
from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_project
from nvscope.simulate.can.definition import can_definitions
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.simulator import open_capture, simulate
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


def project_of(scenario: Scenario, directory: Path) -> Project:
    """Return what the definition files of a scenario's lists on CAN tell, which are written to a directory."""
    paths = []
    for name, text in can_definitions(scenario).items():
        path = directory / f"{name}.gvl"
        path.write_text(text, encoding="utf-8")
        paths.append(str(path))
    return read_project(None, definitions=paths)


def reported(scenario: Scenario, directory: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the truth about a scenario and the report on its capture, with the definitions of its lists on CAN."""
    path = str(directory / "simulated.pcapng")
    with open_capture(scenario, path, path) as sink:
        truth = simulate(scenario, sink)
    inquiry = Inquiry([path], project_of(scenario, directory))
    return truth, inquiry.report(inquiry.analyze())
