"""What all lists have together is limited, and what that leaves out is told; what still fits is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from nvscope.definition import load, resolve
from nvscope.definition.layouts import Layouts
from nvscope.definition.load import load_definitions
from nvscope.definition.model import Problem
from nvscope.definition.wanted_files import DefinitionFile
from nvscope.view.lines.definition_flaws import definition_flaws
from tests.fuzz.definition_floods import gvl
from tests.records import replace


def lists_of(folder: Path, *declarations: str) -> list[str]:
    paths = [folder / f"list{number}.gvl" for number in range(len(declarations))]
    for number, (path, text) in enumerate(zip(paths, declarations, strict=True)):
        path.write_text(gvl(text, index=number + 1))
    return [str(path) for path in paths]


@pytest.mark.parametrize(
    ("limit", "most", "told"),
    [
        ("MAX_ALL_ELEMENTS", 100, "all lists together have 101 elements up to here. They may have 100"),
        ("MAX_ALL_NAME_CHARACTERS", 400, "elements have 404 characters up to here. They may have 400"),
    ],
)
def test_elements_beyond_those_of_all_lists_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, most: int, told: str
) -> None:
    # Each element counts its name, a, and [0] for its index: 4 characters.
    arrays = [f"a : ARRAY[1..{size}] OF BYTE;" for size in (60, 41, 30)]
    paths = lists_of(tmp_path, *arrays, "b : ARRAY[1..10] OF BYTE;\na : BYTE;")
    monkeypatch.setattr(resolve, limit, most)
    definition = load_definitions(paths)
    first, second, third, fourth = definition.lists
    assert [len(one.flaws) for one in definition.lists] == [0, 1, 0, 1]
    assert [flaw.position.file for flaw in second.flaws if isinstance(flaw, Problem)] == [paths[1]]
    sentences = list(definition_flaws(definition))
    assert len(sentences) == 2
    assert told in sentences[0]
    layouts = Layouts(definition)
    known = {one.list_id: layouts.telegrams_of(one.key) for one in definition.lists if one.key}
    assert known[first.list_id] is not None
    assert known[third.list_id] is not None
    # The last variable of the last list is too much; those in front of it are known.
    assert [variable.type.size_bytes for variable in fourth.variables if not hasattr(variable.type, "bounds")] == [0]


@pytest.mark.parametrize(("size", "flaws"), [(50, 0), (51, 1)])
def test_a_list_counts_once_for_each_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int, flaws: int
) -> None:
    monkeypatch.setattr(resolve, "MAX_ALL_ELEMENTS", 100)
    (path,) = lists_of(tmp_path, f"a : ARRAY[1..{size}] OF BYTE;")
    file = load.read_definitions([DefinitionFile(path, path)]).files[path]
    (entry,) = file.lists
    twice = replace(file, lists=(replace(entry, settings=entry.settings * 2),))
    assert [len(one.flaws) for one in resolve.resolve([twice]).lists] == [flaws, flaws]


def test_files_beyond_what_all_may_have_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = lists_of(tmp_path, "a : INT;", "a : INT; (*" + "x" * 900 + "*)", "a : INT;", "a : INT;")
    monkeypatch.setattr(load, "MAX_ALL_CHARACTERS", 1000)
    definition = load_definitions(paths)
    assert [one.name for one in definition.lists] == ["list0", "list2", "list3"]
    (left_out,) = definition.left_out
    assert left_out.position.file == paths[1]
    assert "characters together up to here" in left_out.what
    assert "They may have 1 000: name only" in left_out.next_step
