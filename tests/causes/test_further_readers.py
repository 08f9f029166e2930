"""Readers of a list that others answer, too."""

from __future__ import annotations

from pathlib import Path

from nvscope.simulate.scenario_file import load_scenario, read_scenario
from tests.causes.told import causes_of
from tests.simulate.simulation import Simulation

TWO = Path(__file__).parents[1] / "scenarios" / "acknowledgement-two-readers.toml"
GONE = '[[missing_acknowledgement]]\nlist = "axis"\nreader = "{}"\nfrom = "10s"\n'


def told(fault: str, directory: Path) -> list[tuple[str, str]]:
    text = TWO.read_text("utf-8").partition("[[missing_acknowledgement]]")[0] + fault
    causes = causes_of(Simulation(read_scenario(text)).inquiry(directory))[1]
    return [(cause.title, cause.checked[0]) for cause in causes]


def test_one_that_answers_no_more_is_told_although_nothing_is_missing(tmp_path: Path) -> None:
    ((title, checked),) = told(GONE.format("logger"), tmp_path)
    assert title == "Node 192.168.1.30 answers list 7 no more since 10.0 s"
    assert checked == "192.168.1.20 answers: no acknowledgement is missing"


def test_where_nobody_answers_any_more_it_is_told_of_all(tmp_path: Path) -> None:
    ((title, _),) = told(GONE.format("hmi") + GONE.format("logger"), tmp_path)
    assert title == "None of 2 readers answered for list 7 since 10.0 s"


def test_single_ones_that_one_of_them_misses_are_nothing(tmp_path: Path) -> None:
    assert told('[[missing_acknowledgement]]\nlist = "axis"\nreader = "hmi"\nevery = 3\n', tmp_path) == []
    titles = [cause.title for cause in causes_of(Simulation(load_scenario(TWO)).inquiry(tmp_path))[1]]
    assert not any("no more" in title for title in titles)
