"""What belongs together where no parentheses stand, what a name may look like, and how long all of it may be."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from nvscope.expression.expression import compile_expression
from nvscope.expression.typed_columns import BytesColumn, FieldType, Named
from tests.expression.table import Row, Table

BITS_AND_FLAGS: list[Row] = [
    {"n.byte": number, "n.dint": number - 2, "f.on": on, "f.ready": ready, "f.sent": sent}
    for number, on, ready, sent in product(range(5), (False, True), (False, True), (False, True))
]


@pytest.mark.parametrize(
    ("written", "means", "does_not_mean"),
    [
        ("f.on || f.ready && f.sent", "f.on || (f.ready && f.sent)", "(f.on || f.ready) && f.sent"),
        ("f.on && f.ready || f.sent", "(f.on && f.ready) || f.sent", "f.on && (f.ready || f.sent)"),
        ("f.on || f.ready ^^ f.sent", "f.on || (f.ready ^^ f.sent)", "(f.on || f.ready) ^^ f.sent"),
        ("f.on ^^ f.ready && f.sent", "f.on ^^ (f.ready && f.sent)", "(f.on ^^ f.ready) && f.sent"),
        ("!f.on && f.ready", "(!f.on) && f.ready", "!(f.on && f.ready)"),
        ("!n.byte == 3", "!(n.byte == 3)", "n.byte == 3"),
        ("not f.on or f.ready", "(not f.on) or f.ready", "not (f.on or f.ready)"),
        ("n.byte & 1 == 1", "(n.byte & 1) == 1", "n.byte == 1"),
        ("n.byte + 1 & 1 == 1", "((n.byte + 1) & 1) == 1", "n.byte + (1 & n.byte) == 1"),
        ("n.byte + 2 * 3 == 7", "n.byte + (2 * 3) == 7", "(n.byte + 2) * 3 == 7"),
        ("n.byte - 1 - 1 == 1", "(n.byte - 1) - 1 == 1", "n.byte - (1 - 1) == 1"),
        ("n.byte * 4 / 3 == 4", "(n.byte * 4) / 3 == 4", "n.byte * (4 / 3) == 4"),
        ("n.dint == -n.byte", "n.dint == (0 - n.byte)", "n.dint == n.byte"),
        ("-n.dint + 1 == 0", "(-n.dint) + 1 == 0", "-(n.dint + 1) == 0"),
        ("1 < n.byte <= 3", "1 < n.byte && n.byte <= 3", "n.byte <= 3"),
    ],
)
def test_precedence(written: str, means: str, does_not_mean: str) -> None:
    table = Table(BITS_AND_FLAGS, [])
    assert table.chosen(written) == table.chosen(means)
    assert table.chosen(written) != table.chosen(does_not_mean)


def test_a_name_may_have_an_index_and_look_like_a_part() -> None:
    names = {
        "var.a[1]": Named(FieldType.SIGNED),
        "var.a[1].b": Named(FieldType.REAL),
        "var.sName": Named(FieldType.TEXT),
    }
    assert compile_expression("var.a[1] == 5 && VAR.A[1].B > 1.5", names).fields == ("var.a[1]", "var.a[1].b")
    assert compile_expression('var.sname[1] == "b"', names).fields == ("var.sName",)


def test_names_hold_letters_of_any_alphabet_and_negative_indexes() -> None:
    numbers = {
        "var.höhe": 1,
        "var.Прес.давление": 2,
        "var.a[-1]": 3,
        "var.a[-1].x": 4,
        "var.m[1,-2].x": 5,
        "var.m[-1,2]": 6,
    }
    names: dict[str, Named] = {name: Named(FieldType.SIGNED) for name in numbers}
    names["nv.data"] = Named(FieldType.BYTES)
    for name, number in numbers.items():
        for said in (f"{name.upper()} == {number}", f"{name} in {{{name}..{number}}}", f"{name}-1 == {number - 1}"):
            expression = compile_expression(said, names)
            assert expression.fields == (name,)
            value = np.array([number])
            assert expression.mask(lambda _, value=value: (value, None)).tolist() == [True]  # type: ignore[misc]
    for part, wanted in {"-2:": "03:04", "-1": "04", "-1,0": "04:01", "1--1": "02:03:04"}.items():
        column = BytesColumn(np.array([1, 2, 3, 4], np.uint8), np.array([0]), np.array([4]))
        expression = compile_expression(f"nv.data[{part}] == {wanted}", names)
        assert expression.mask(lambda _, column=column: (column, None)).tolist() == [True]  # type: ignore[misc]


def test_what_is_long_but_not_deep_is_no_mistake() -> None:
    table = Table([{"n.byte": 1, "f.on": True}], [])
    assert table.chosen(" && ".join(["f.on"] * 1000)) == [True]
    assert table.chosen("(" * 300 + "f.on" + ")" * 300) == [True]
    assert table.chosen("n.byte in {" + ", ".join(map(str, range(1, 1500))) + "}") == [True]
    assert table.chosen("n.byte" + " + 1" * 1000 + " == 1001") == [True]
