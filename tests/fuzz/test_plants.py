"""No definitions make the program fall over, hang or contradict itself: a bounded run of the fuzzer, and floods.

``python -m tests.fuzz.run --what plants`` does the first part for as long as it is told to.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from nvscope.errors import ExitCode
from tests.fuzz.asked import Answered, Plant
from tests.fuzz.definition_floods import DEFINITION_FLOODS, Files, doubled_names, gvl, long_name_of_array
from tests.fuzz.definition_mutations import AIMED_AT_TEXT, Change
from tests.fuzz.examination import assert_printable, ends
from tests.fuzz.originals import CAPTURES, sample_captures
from tests.fuzz.plants import fuzz_plant, sample_definitions
from tests.fuzz.program import Ran, run
from tests.fuzz.questions import ask

PLANTS = 6
SHARE_OF_FLOODS = 10
"""Floods are a tenth of what they may be: what goes down into something, or squares it, shows there too."""


def layout_of(files: Files, folder: Path, *words: str) -> Ran:
    """Return what ``gvl layout`` makes of some files."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    project = folder / "nvscope.toml"
    project.write_text('definitions = ["*.[gs][vt]*"]\n')
    return run("gvl", "layout", "--project", str(project), *words)


def test_the_peers_are_answered_to_the_end(tmp_path: Path) -> None:
    plant = Plant(sample_captures()["peers/peers.pcap"], sample_definitions()[0])
    answered = ask(plant, tmp_path, random.Random(1))
    assert answered.readable
    assert answered.defined
    assert answered.decoded == 813
    assert answered.values > answered.decoded
    assert answered.drafts == 4


def test_drawn_plants_are_refused_or_answered_alike(tmp_path: Path) -> None:
    reached: list[Answered] = []
    for number in range(PLANTS):
        folder = tmp_path / str(number)
        folder.mkdir()
        _, plant = fuzz_plant(1000, number)
        reached.append(ask(plant, folder, random.Random(number)))
    # A fuzzer that only makes files that are refused at once tests nothing.
    assert sum(one.readable for one in reached) > PLANTS // 2
    assert sum(one.defined for one in reached) > PLANTS // 3
    assert sum(one.decoded > 0 for one in reached) > PLANTS // 5


def test_the_same_seed_makes_the_same_plant() -> None:
    assert [fuzz_plant(3, number) for number in range(6)] == [fuzz_plant(3, number) for number in range(6)]


@pytest.mark.parametrize("change", dict.fromkeys(AIMED_AT_TEXT))
def test_every_mutation_changes_definitions(change: Change) -> None:
    text = (CAPTURES / "peers" / "axis.gvl").read_text()
    made = {change(random.Random(seed), text, [text, gvl("other : LREAL;")]) for seed in range(20)}
    assert len(made - {text}) > 3


@pytest.mark.parametrize("name", DEFINITION_FLOODS)
def test_floods_of_definitions_end_in_a_layout_or_in_words(tmp_path: Path, name: str) -> None:
    flood, count = DEFINITION_FLOODS[name]
    with ends():
        ran = layout_of(flood(max(count // SHARE_OF_FLOODS, 60 if count < 1000 else 1)), tmp_path)
    assert ran.code in (ExitCode.GOOD, ExitCode.USAGE)
    assert_printable(ran.out)
    assert_printable(ran.err)
    assert ran.err or ran.code == ExitCode.GOOD


@pytest.mark.parametrize("files", [long_name_of_array(10_000), doubled_names(40)], ids=["one name", "many members"])
def test_names_that_would_fill_the_memory_are_left_out(tmp_path: Path, files: Files) -> None:
    """An array of 100 000 elements repeats what stands before its brackets 100 000 times."""
    ran = layout_of(files, tmp_path)
    assert ran.code == ExitCode.GOOD
    assert len(ran.out) < 1_000_000
    assert "a.gvl, line 2, column 1: the names of the list's elements have" in ran.err
    assert "They may have 20000000: shorten names, or the arrays." in ran.err


def test_types_may_be_declared_before_those_that_use_them_to_any_number(tmp_path: Path) -> None:
    """Ten thousand types side by side are many; a hundred and one within one another are too deep in either order."""
    beside = "".join(f"TYPE T{number} : STRUCT a : INT; END_STRUCT END_TYPE\n" for number in range(10_000))
    assert layout_of({"a.gvl": gvl("a : T0; b : T9999;"), "t.st": beside}, tmp_path).code == ExitCode.GOOD
    cube = ", ".join(["0..0"] * 101)
    assert "nested deeper than 100" in layout_of({"a.gvl": gvl(f"a : ARRAY[{cube}] OF INT;")}, tmp_path).err
    for depth in (100, 101):
        within = "TYPE T0 : INT; END_TYPE\n" + "".join(
            f"TYPE T{number} : STRUCT m : T{number - 1}; END_STRUCT END_TYPE\n" for number in range(1, depth + 1)
        )
        ran = layout_of({"a.gvl": gvl(f"a : T{depth};"), "t.st": within}, tmp_path)
        assert ran.code == ExitCode.GOOD
        assert (f"line {depth + 1}, column 13: types are nested deeper than 100" in ran.err) == (depth > 100)
