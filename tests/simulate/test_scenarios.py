"""The scenarios of ``tests/scenarios``: what each one expects, strictly in both directions, is what was put into it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nvscope.findings.catalogue import CATALOGUE
from nvscope.protocols.visu import VISU
from nvscope.simulate.scenario_file import load_scenario
from nvscope.tracker.figures import LIST_COUNTERS
from tests.simulate.comparison import by_list
from tests.simulate.simulation import Simulation, simulated

SCENARIOS = sorted((Path(__file__).parent.parent / "scenarios").glob("*.toml"))
TAME = [path for path in SCENARIOS if not load_scenario(path).wild]
NEEDS_A_DEFINITION = {"NV405", "NV406", "NV407", "NV601", "NV605"}
NEEDS_A_FILE = {"NV901", "NV903", "NV904"}
NEEDS_MANY = {"NV906"}
LIVE_ONLY = {"NV907"}
WILD = {"NV808", "NV963", "NV964"}
"""Where two have one address, or one Counter, or pages are cut, the truth about counters is not exact."""
NOT_SIMULATED = {"NV810"}
"""Nothing is captured in another order."""


def found(findings: list[dict[str, Any]]) -> dict[str, set[str]]:
    """Return the codes of findings by list, those of none under "capture"."""
    codes: dict[str, set[str]] = {}
    for finding in findings:
        codes.setdefault(finding["list"] or "capture", set()).add(finding["code"])
    return codes


def counted(truth: dict[str, Any]) -> dict[str, dict[str, int]]:
    """Return the counters of each list that are not 0."""
    counters = {
        entry["key"]: {name: value for name, value in entry["counters"].items() if value} for entry in truth["lists"]
    }
    return {key: values for key, values in counters.items() if values}


def written(simulation: Simulation) -> list[str]:
    """Return the writes of parameters as scenarios have them."""
    names = {node.address: node.name for node in simulation.scenario.node}
    return [
        f"{names[one['requester']]} -> {names[one['partner']]} 0x{one['index']:04x}:{one['subindex']}: "
        f"{one['old_text'] or '?'} -> {one['new_text']}, {' '.join(filter(None, (one['outcome'], one['error'])))}"
        for one in simulation.parameters.writes
    ]


def written_by_pages(simulation: Simulation) -> list[str]:
    """Return the writes of pages as scenarios have them."""
    names = {node.address: node.name for node in simulation.scenario.node}
    return [
        f"{names[str(one.pair[0])]} -> {names[str(one.pair[1])]} {one.variable}: "
        f"{'?' if one.old is None else one.old} -> {one.new}, {one.outcome}"
        for one in simulation.visu.writes
    ]


@pytest.mark.parametrize("path", TAME, ids=[path.stem for path in TAME])
def test_a_scenario_expects_what_was_put_into_it(path: Path) -> None:
    simulation = simulated(path)
    expect = simulation.scenario.expect
    assert expect is not None
    assert expect.findings is not None
    assert found(simulation.findings) == {key: set(codes) for key, codes in by_list(expect.findings).items()}
    assert counted(simulation.truth) == by_list(expect.counters or {})
    assert written(simulation) == list(expect.writes)
    assert written_by_pages(simulation) == list(expect.page_writes)


@pytest.mark.parametrize("path", SCENARIOS, ids=[path.stem for path in SCENARIOS])
def test_a_scenario_says_what_happens(path: Path) -> None:
    text = path.read_text("utf-8")
    assert text.startswith("# ")
    assert len(text.split("title =")[0]) > 60
    assert load_scenario(path).title


def test_every_finding_and_every_counter_occurs() -> None:
    codes: set[str] = set()
    counters: set[str] = set()
    for path in TAME:
        expect = load_scenario(path).expect
        assert expect is not None
        codes |= {code for entry in (expect.findings or {}).values() for code in entry}
        counters |= {name for entry in (expect.counters or {}).values() for name in entry}
    of_visu = {kind.code for kind in VISU.findings()}
    judged = {code for code, kind in CATALOGUE.items() if kind.judged and not kind.protocol}
    not_shown = NEEDS_A_DEFINITION | NEEDS_A_FILE | NEEDS_MANY | LIVE_ONLY | WILD | NOT_SIMULATED
    assert codes == (of_visu | judged) - not_shown
    # What counters claim that are not believed, a scenario cannot say: it does not put it in.
    assert counters == {counter.name for counter in LIST_COUNTERS} - {"lost_claimed"}
