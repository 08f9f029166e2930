"""The table of a served WebVisu: strict, with what is wrong named."""

from __future__ import annotations

from pathlib import Path

import pytest

from dissectors.webvisu import Place
from nvscope.errors import ConfigurationError
from nvscope.plc.visu.table import document
from tests.plc.visu.peers import table_of


def test_variables_lie_one_behind_the_other_unless_they_say_where(tmp_path: Path) -> None:
    table = table_of(
        tmp_path,
        """
        "a" = { type = "INT", value = -7 }
        "b" = { type = "STRING(5)", value = "a|b" }
        "c" = { address = "4,10,4,REAL", value = 1.5 }
        "d" = { address = "2,4,0,0", value = true }
        """,
    )
    assert [(one.name, one.place, one.value) for one in table.entries] == [
        ("a", Place(4, 14, 2, 1), "-7"), ("b", Place(4, 16, 6, 8), "a|b"), ("c", Place(4, 10, 4, 6), "1.5"),
        ("d", Place(2, 4, 0, 0), "1"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("variables", "head", "told"),
    [
        ('"a".tpye = "INT"', "", "unknown key 'tpye'"),
        ('"a" = {}', "", "a variable has a type or an address"),
        ('"a" = { type = "INT", address = "4,0,2,1" }', "", "a variable has a type or an address"),
        ('"a" = { type = "WSTRING(5)" }', "", "no WSTRING"),
        ('"a" = { type = "LTIME" }', "", "no LTIME"),
        ('"a" = { address = "4,0" }', "", "an address is expected"),
        ('"a" = { type = "BYTE", value = 256 }', "", "out of the range"),
        ('"a" = { type = "STRING(2)", value = "abc" }', "", "has room for 2"),
        ('"a" = { type = "STRING(2)", value = 1 }', "", "a text is expected"),
        ('"a" = { type = "INT", value = [1] }', "", "found a table or an array"),
        ('"a" = { type = "INT", delay = "2m" }', "", "no more than a minute"),
        ('"a" = { type = "INT", access = "none" }', "", "none of the choices"),
        ('"a" = { address = "4,0,2,1" }\n"b" = { address = "4,0,2,1" }', "", "another variable lies at 4,0,2,1"),
        ('"a" = { type = "INT" }\n"A" = { type = "INT" }', "", "names are the same in any case"),
        ('"\\u001b" = { type = "INT" }', "", "printable characters"),
        ("", 'path = "webvisu.htm"', "a path begins with a slash"),
        ("", "keep_alive = true\ncontent_length = false", "a connection is kept only where"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, variables: str, head: str, told: str) -> None:
    with pytest.raises(ConfigurationError) as raised:
        table_of(tmp_path, variables, head)
    assert told in str(raised.value)
    assert "served.toml" in raised.value.where


def test_all_keys_are_listed() -> None:
    assert "- `surplus` (whole number -100 to 100, default `0`)" in document()
