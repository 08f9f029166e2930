"""Types of parameters that are more than elementary: how the project file says them, and how their values lie."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nvscope.definition.parameter_layout import parameter_layout
from nvscope.definition.parameters import ParameterDefinition
from nvscope.definition.project_file import read_project
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Array, Enumeration, Member, String, Structure, Type
from nvscope.errors import ConfigurationError

TYPES = """TYPE Axis : STRUCT nState : E_State; arPos : ARRAY [1..2] OF REAL; END_STRUCT END_TYPE
TYPE E_State : (eOff, eRun := 5) INT; END_TYPE
VAR_GLOBAL CONSTANT cAxes : INT := 3; END_VAR
TYPE Odd : STRUCT p : POINTER TO INT; END_STRUCT END_TYPE
"""
E_STATE = Enumeration("E_State", SCALARS["INT"], {"eOff": 0, "eRun": 5})
AXIS = Structure("Axis", (Member("nState", E_STATE), Member("arPos", Array(((1, 2),), SCALARS["REAL"]))))


def parameter_type(tmp_path: Path, text: str, head: str = 'definitions = "types.st"') -> Any:
    """Return the type of a parameter whose type is written so, in a project with ``TYPES``."""
    (tmp_path / "types.st").write_text(TYPES)
    path = tmp_path / "nvscope.toml"
    path.write_text(f'{head}\n[parameters]\n"1:0" = {{ type = "{text}" }}')
    known = read_project(path).definition.parameters
    assert known is not None
    return known.known[0].type


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("Axis", AXIS),
        ("axis", AXIS),
        ("E_State", E_STATE),
        ("ARRAY [0..3] OF INT", Array(((0, 3),), SCALARS["INT"])),
        ("ARRAY[1..cAxes, 0..1] OF Axis", Array(((1, 3), (0, 1)), AXIS)),
        ("ARRAY [1..2] OF STRING(7)", Array(((1, 2),), String(7))),
    ],
)
def test_a_parameter_is_of_a_type_that_the_definitions_declare(tmp_path: Path, text: str, kind: Any) -> None:
    assert parameter_type(tmp_path, text) == kind


def test_an_array_needs_no_definition(tmp_path: Path) -> None:
    assert parameter_type(tmp_path, "ARRAY [0..1] OF REAL", "") == Array(((0, 1),), SCALARS["REAL"])


def test_definitions_that_take_the_place_of_the_projects_do_not_take_these_types_away(tmp_path: Path) -> None:
    assert parameter_type(tmp_path, "Axis") == AXIS
    (tmp_path / "other.st").write_text("TYPE Other : STRUCT n : INT; END_STRUCT END_TYPE\n")
    known = read_project(tmp_path / "nvscope.toml", [str(tmp_path / "other.st")]).definition.parameters
    assert known is not None
    assert known.known[0].type == AXIS


@pytest.mark.parametrize(
    ("text", "what", "next_step"),
    [
        ("Axs", "no definition file declares 'Axs'", "Perhaps Axis is meant."),
        ("ARRAY [0..3] OF Nothing", "no definition file declares 'Nothing'", "Add the file"),
        ("ARRAY [0..cMany] OF INT", "no definition file declares 'cMany'", "Add the file"),
        ("Odd", "nobody knows how many bytes 'Odd' has", "without pointers"),
        ("ARRAY [0..40000] OF INT", "OF INT' has 80", "bounds"),
        ("ARRAY [0..99999999] OF INT", "elements, more than", "bounds"),
        ("INT; q : INT", "is no type", "as in a declaration"),
        ("INT := 5", "is no type", "as in a declaration"),
        ("INT; END_VAR TYPE A : INT", "is no type", "as in a declaration"),
        ("ARRAY [0..", "is no type", "as in a declaration"),
        ("", "is no type", "Known are"),
        ("A" * 201, "is no type", "Known are"),
    ],
)  # fmt: skip
def test_what_is_no_type_of_a_parameter_is_told_with_its_place(
    tmp_path: Path, text: str, what: str, next_step: str
) -> None:
    with pytest.raises(ConfigurationError) as error:
        parameter_type(tmp_path, text)
    assert str(error.value.where).endswith(': parameters."1:0".type')
    assert what in error.value.what
    assert next_step in error.value.next_step


INT, REALS = SCALARS["INT"], Array(((1, 2),), SCALARS["REAL"])


@pytest.mark.parametrize(
    ("kind", "items", "size_bytes", "elements"),
    [
        (INT, 1, 2, ["p"]),
        (INT, 2, 4, ["p[0]", "p[1]"]),
        (INT, 2, 2, None),
        (INT, 0, 2, None),
        (INT, 0, 0, None),
        (E_STATE, 1, 2, ["p"]),
        (REALS, 1, 8, ["p[1]", "p[2]"]),
        (REALS, 2, 8, ["p[1]", "p[2]"]),
        (REALS, 2, 16, ["p[0][1]", "p[0][2]", "p[1][1]", "p[1][2]"]),
        (REALS, 1, 4, None),
        (AXIS, 1, 10, ["p.nState", "p.arPos[1]", "p.arPos[2]"]),
        (AXIS, 3, 10, ["p.nState", "p.arPos[1]", "p.arPos[2]"]),
        (AXIS, 1, 9, None),
        (None, 1, 2, None),
    ],
)  # fmt: skip
def test_where_the_elements_of_a_value_lie(
    kind: Type | None, items: int, size_bytes: int, elements: list[str] | None
) -> None:
    found = parameter_layout(ParameterDefinition(1, 0, "p", kind), "p", items, size_bytes)
    assert (None if found is None else [element.name for element in found.elements]) == elements
    assert found is None or found.layout.size_bytes == size_bytes
