"""Each key of a TOML file is found where it stands, whatever strings, arrays and comments are around it."""

from __future__ import annotations

import tomllib
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from nvscope.toml_positions import Path, Position, positions
from tests.laws import examples

FILE = '''# rules
include = ["a", # one
  "b = 3", """c]
"""]

[defaults]
"warm up" = "2s"
[[rule]]
  id = "x # no comment"
a.b = 3
[[rule]]
text = \'\'\'
id = "not this"
[rule]
\'\'\'
id = { x = 1, y = "}" } # [
list = [1,
2]
other = 1
[[rule.test]]
id = 1
[ rule.more ]
z = 'a"b'
'''


def test_keys_are_where_they_stand() -> None:
    assert positions(FILE) == {
        ("include",): Position(2, 1),
        ("defaults",): Position(6, 2),
        ("defaults", "warm up"): Position(7, 1),
        ("rule", 0): Position(8, 3),
        ("rule", 0, "id"): Position(9, 3),
        ("rule", 0, "a", "b"): Position(10, 1),
        ("rule", 1): Position(11, 3),
        ("rule", 1, "text"): Position(12, 1),
        ("rule", 1, "id"): Position(16, 1),
        ("rule", 1, "list"): Position(17, 1),
        ("rule", 1, "other"): Position(19, 1),
        ("rule", 1, "test", 0): Position(20, 3),
        ("rule", 1, "test", 0, "id"): Position(21, 1),
        ("rule", 1, "more"): Position(22, 3),
        ("rule", 1, "more", "z"): Position(23, 1),
    }


def _at(document: Any, path: Path) -> Any:
    for part in path:
        document = document[part]
    return document


names = st.sampled_from(["a", "b-c", "d_1", '"e f"', "'g.h'"])
values = st.sampled_from(
    ["1", '"x"', '"# = [["', "'''\na = 1\n[b]\n'''", '"""\n\\"""\nz = 2\n"""', "[1,\n# ]\n2]", "{ q = [1], r = '}' }"]
)
lines = st.one_of(
    st.just("# [[a]] = 1"), st.just(""), st.tuples(st.just("key"), names, values), st.tuples(st.just("[["), names),
)  # fmt: skip


@examples(200)
@given(st.lists(lines, max_size=12))
def test_all_keys_of_drawn_files_are_found(drawn: list[Any]) -> None:
    texts, used = [], set[tuple[int, str]]()
    table = 0
    for one in drawn:
        if isinstance(one, str):
            texts.append(one)
        elif one[0] == "[[":
            table += 1
            texts.append(f"[[t.{one[1]}]]")
        elif (table, one[1]) not in used:
            used.add((table, one[1]))
            texts.append(f"{one[1]} = {one[2]} # {one[1]} = 2")
    text = "\n".join(texts)
    document = tomllib.loads(text)
    found = positions(text)
    for path, position in found.items():
        _at(document, path)
        line = text.split("\n")[position.line - 1][position.column - 1 :]
        name = next(part for part in reversed(path) if isinstance(part, str))
        assert line.lstrip("t.").lstrip("\"'").startswith(name), (path, line)
    keys = sum(1 for path in found if isinstance(path[-1], str))
    assert keys == len(used)
