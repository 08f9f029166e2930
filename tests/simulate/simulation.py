"""Simulation: a scenario and all that comes of it. That of a file is made once in a run, for every test that asks."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from nvscope.analysis.inquiry import Inquiry
from nvscope.definition.project import Project
from nvscope.definition.project_file import read_project
from nvscope.simulate.definition import definitions
from nvscope.simulate.scenario import Scenario
from nvscope.simulate.scenario_facts import make_scenario_facts
from nvscope.simulate.scenario_file import load_scenario
from nvscope.simulate.simulator import BATCH_FRAMES, all_packets, channels_of, open_capture
from nvscope.simulate.truth import make_truth
from tests.oracle.frame import Frame
from tests.oracle.rules.security import security_rows
from tests.simulate.collected import frames_of
from tests.simulate.expected.findings import expected_findings
from tests.simulate.expected.parameters import ExpectedOfParameters, expected_of_parameters
from tests.simulate.expected.visu import ExpectedOfVisu, expected_of_visu


class Simulation:
    """What the simulator makes of a scenario, in its own steps, and the findings that must be made of that.

    Nobody can change it for others: columns of ``batches`` refuse to be written, truth and findings are copies.
    """

    def __init__(self, scenario: Scenario) -> None:
        facts = make_scenario_facts(scenario)
        self.scenario = scenario
        self.channels = channels_of(scenario)
        self._truth = make_truth(facts)
        self.batches = tuple(all_packets(scenario, facts.table, facts.can_table, BATCH_FRAMES))
        self._findings = expected_findings(facts)
        self.project = scenario.expect.project if scenario.expect is not None else ""
        self._parameters = ExpectedOfParameters()
        if scenario.parameter or any(one.kind == "parameter" for one in scenario.traffic):
            self._parameters = expected_of_parameters(self.frames())
            self._findings += self._parameters.findings
        self._visu = ExpectedOfVisu()
        if scenario.page:
            self._visu = expected_of_visu(self.frames())
            self._findings += self._visu.findings
        self._findings += self._of_security() if self.project or scenario.scan else []
        for batch in self.batches:
            for name in batch.__struct_fields__:
                if isinstance(values := getattr(batch, name), np.ndarray):
                    values.flags.writeable = False

    @property
    def truth(self) -> dict[str, Any]:
        return copy.deepcopy(self._truth)

    @property
    def findings(self) -> list[dict[str, Any]]:
        return copy.deepcopy(self._findings)

    @property
    def parameters(self) -> ExpectedOfParameters:
        return copy.deepcopy(self._parameters)

    @property
    def visu(self) -> ExpectedOfVisu:
        return copy.deepcopy(self._visu)

    def frames(self) -> Iterator[Frame]:
        return frames_of(self.batches)

    def _of_security(self) -> list[dict[str, Any]]:
        """Return what is to be told of who should not be there, by what the project file of the scenario says."""
        names = ("code", "list", "node", "subindex", "count")
        rows = security_rows(self.frames(), tomllib.loads(self.project))
        return [dict(zip(names, row, strict=True)) for row in rows]

    def write(self, path: Path) -> Path:
        """Write a capture in the format that its name says, and return where it is."""
        with open_capture(self.scenario, str(path), str(path)) as sink:
            for batch in self.batches:
                sink.write(batch)
        return path

    def inquiry(self, directory: Path) -> Inquiry:
        """Return an inquiry into a capture of it, with the definitions of its lists; both lie in a directory."""
        return Inquiry([str(self.write(directory / "simulated.pcapng"))], project_of(self.scenario, directory))

    def report(self, directory: Path) -> dict[str, Any]:
        """Return the report on it, made anew."""
        inquiry = self.inquiry(directory)
        return inquiry.report(inquiry.analyze(causes=True))


@cache
def simulated(path: Path) -> Simulation:
    """Return the simulation of a scenario file."""
    return Simulation(load_scenario(path))


def project_of(scenario: Scenario, directory: Path) -> Project:
    """Return what the definition files of a scenario's lists, and its project file, tell; all go to a directory."""
    paths = []
    for name, text in definitions(scenario).items():
        path = directory / f"{name}.gvl"
        path.write_text(text, encoding="utf-8")
        paths.append(str(path))
    if scenario.expect is None or not scenario.expect.project:
        return read_project(None, definitions=paths)
    (directory / "nvscope.toml").write_text(scenario.expect.project, encoding="utf-8")
    return read_project(directory / "nvscope.toml", definitions=paths)
