"""Laws: no bytes give anything but a definition or an error with its place; how a text is written does not matter."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from nvscope.definition.foreign_files import FOREIGN_FILES
from nvscope.definition.load import load_definitions
from nvscope.errors import ConfigurationError
from tests.definition.declared import SAMPLES, declared, shown
from tests.laws import examples

FILES = {path.name: path.read_bytes() for path in sorted(SAMPLES.iterdir())}
PLACE = re.compile(r".+, line [1-9]\d*, column [1-9]\d*", re.DOTALL)


def mutated(data: bytes, choice: random.Random) -> bytes:
    """Return bytes with some flipped, cut off, left out, repeated or taken from another file."""
    for _ in range(choice.randint(1, 4)):
        first, second = sorted(choice.randrange(len(data) + 1) for _ in range(2))
        other = choice.choice(list(FILES.values()))
        start = choice.randrange(len(other))
        kind = choice.randrange(6)
        if kind == 0 and data:
            at = choice.randrange(len(data))
            data = data[:at] + bytes([choice.randrange(256)]) + data[at + 1 :]
        elif kind == 1:
            data = data[:second]
        elif kind == 2:
            data = data[:first] + data[min(second, first + 20) :]
        elif kind == 3:
            data = data[:first] + other[start : start + choice.randrange(60)] + data[first:]
        elif kind == 4:
            word = choice.choice(
                [b"(*", b"*)", b"'", b"{", b"]]>", b"-", b"(", b"END_VAR", b"TYPE", b"99", b"\xff", b"."]
            )
            data = data[:first] + word + data[first:]
        else:
            data = data[:first] + data[first : first + 40] + data[first:]
    return data


@pytest.mark.parametrize("name", FILES)
@examples(200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32))
def test_mutated_files_are_definitions_or_errors_with_a_place(name: str, seed: int, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_bytes(mutated(FILES[name], random.Random(seed)))
    others = [str(SAMPLES / other) for other in FILES if other != name and other.endswith((".st", ".TcDUT"))]
    problem: ConfigurationError | None = None
    try:
        load_definitions([str(file), *others])
    except ConfigurationError as error:
        problem = error
    if problem is not None:
        assert PLACE.fullmatch(problem.where), problem.where
        assert problem.what
        assert problem.next_step


@examples(200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=200))
def test_any_bytes_are_a_definition_or_an_error_with_a_place(data: bytes, tmp_path: Path) -> None:
    file = tmp_path / "any"
    file.write_bytes(data)
    try:
        assert not load_definitions([str(file)]).lists  # such as a comment alone
    except ConfigurationError as error:
        assert PLACE.fullmatch(error.where) or error.what in {kind.what for kind in FOREIGN_FILES}  # noqa: PT017


SCALARS = ["BOOL", "INT", "UDINT", "LREAL", "TIME", "DT", "LWORD", "LTOD"]
NAMES = [f"{word}{number}" for word in ("a", "Value", "speed_", "_x") for number in range(12)]


def type_tokens() -> st.SearchStrategy[tuple[list[str], str]]:
    """Return types as tokens, and as ``shown`` shows them."""
    scalar = st.sampled_from(SCALARS).map(lambda name: ([name], name))
    string = st.tuples(st.sampled_from(["STRING", "WSTRING"]), st.integers(1, 300), st.booleans()).map(
        lambda drawn: (
            [drawn[0], "(" if drawn[2] else "[", str(drawn[1]), ")" if drawn[2] else "]"], f"{drawn[0]}({drawn[1]})",
        )
    )  # fmt: skip
    subrange = st.integers(-5, 5).map(
        lambda low: (["INT", "(", str(low), "..", "16#10", "+", "1", ")"], f"INT({low}..17)")
    )
    simple = st.one_of(scalar, string, subrange)
    return st.recursive(simple, lambda inner: st.one_of(array_tokens(inner), structure_tokens(inner)), max_leaves=8)


def array_tokens(inner: st.SearchStrategy[tuple[list[str], str]]) -> st.SearchStrategy[tuple[list[str], str]]:
    bounds = st.lists(st.tuples(st.integers(-2, 2), st.integers(0, 2)), min_size=1, max_size=3)

    def made(drawn: tuple[list[tuple[int, int]], tuple[list[str], str]]) -> tuple[list[str], str]:
        dimensions, (tokens, text) = drawn
        ranges = [[str(low), "..", "(", str(low), "+", str(more), ")"] for low, more in dimensions]
        between = [token for number, part in enumerate(ranges) for token in ([","] if number else []) + part]
        bounds_text = ", ".join(f"{low}..{low + more}" for low, more in dimensions)
        return ["ARRAY", "[", *between, "]", "OF", *tokens], f"ARRAY[{bounds_text}] OF {text}"

    return st.tuples(bounds, inner).map(made)


def structure_tokens(inner: st.SearchStrategy[tuple[list[str], str]]) -> st.SearchStrategy[tuple[list[str], str]]:
    members = st.lists(st.tuples(st.sampled_from(NAMES), inner), max_size=3, unique_by=lambda member: member[0].upper())

    def made(drawn: list[tuple[str, tuple[list[str], str]]]) -> tuple[list[str], str]:
        tokens = [token for name, (inside, _) in drawn for token in (name, ":", *inside, ";")]
        text = " ".join(f"{name}: {shown_type};" for name, (_, shown_type) in drawn)
        return ["STRUCT", *tokens, "END_STRUCT"], f"STRUCTURE {text}"

    return members.map(made)


def written(tokens: list[str], choice: random.Random) -> str:
    """Return tokens as text: keywords in any case, between them any blanks, comments and pragmas."""
    blanks = [" ", "\n", "\t", "\r\n", "(* a (* b *) 'c *)", "// d '\n", "/* e */", "{region 'f'}", "{attribute 'g'}"]
    text = ""
    for token in tokens:
        kept = token in NAMES
        spelled = token if kept else "".join(choice.choice([letter.lower(), letter.upper()]) for letter in token)
        text += choice.choice(blanks) + choice.choice(["", *blanks]) + spelled
    return text + choice.choice(blanks)


@examples(150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    drawn=st.lists(
        st.tuples(st.sampled_from(NAMES), type_tokens()), min_size=1, max_size=5, unique_by=lambda one: one[0]
    ),
    seed=st.integers(0, 2**32),
)
def test_how_a_declaration_is_written_does_not_matter(
    drawn: list[tuple[str, tuple[list[str], str]]], seed: int, tmp_path: Path
) -> None:
    tokens = [token for name, (inside, _) in drawn for token in (name, ":", *inside, ";")]
    text = written(["VAR_GLOBAL", *tokens, "END_VAR"], random.Random(seed))
    (found,) = declared(text, tmp_path).lists
    assert [(variable.name, shown(variable.type)) for variable in found.variables] == [
        (name, shown_type) for name, (_, shown_type) in drawn
    ]
    lines = text.splitlines()
    for variable in found.variables:
        assert lines[variable.position.line - 1][variable.position.column - 1 :].startswith(variable.name)
