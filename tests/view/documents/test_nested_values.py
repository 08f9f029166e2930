"""Values of elements as objects and arrays."""

from __future__ import annotations

from typing import Any

import pytest

from nvscope.definition.position import Position
from nvscope.definition.scalars import SCALARS
from nvscope.definition.variables import Array, Member, Structure, Type, Variable, elements
from nvscope.view.documents.nested_values import nested

INT = SCALARS["INT"]
LIMITS = Structure("Limits", (Member("nLow", INT), Member("nHigh", INT)))


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (INT, 0),
        (LIMITS, {"nLow": 0, "nHigh": 1}),
        (Array(((1, 3),), INT), [0, 1, 2]),
        (Array(((-1, 0), (2, 3)), INT), [[0, 1], [2, 3]]),
        (Array(((0, 1),), Array(((0, 1),), INT)), [[0, 1], [2, 3]]),
        (Array(((0, 1),), LIMITS), [{"nLow": 0, "nHigh": 1}, {"nLow": 2, "nHigh": 3}]),
        (Structure("S", (Member("a", INT), Member("of", LIMITS), Member("an", Array(((0, 0),), INT)))),
         {"a": 0, "of": {"nLow": 1, "nHigh": 2}, "an": [3]}),
    ],
)  # fmt: skip
def test_values_stand_as_their_type_is_declared(kind: Type, told: Any) -> None:
    names = [one.name.removeprefix("p") for one in elements(Variable("p", kind, Position("", 0, 0)))]
    assert nested(zip(names, range(len(names)), strict=True)) == told
