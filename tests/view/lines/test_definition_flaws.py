"""What is said about definition files in which something is wrong or missing."""

from __future__ import annotations

from nvscope.definition.model import Definition, Flaw, ListDefinition, Problem, UnknownName
from nvscope.definition.position import Position
from nvscope.units import count
from nvscope.view.lines.definition_flaws import definition_flaws

END = "Name the files that do, too: a .TcDUT, a PLCopen XML export, ST text, or a list of constants."


def name(text: str, line: int = 1, **others: object) -> UnknownName:
    return UnknownName(text, Position("plc/a.gvl", line, 5), **others)  # type: ignore[arg-type]


def told(*flaws: Flaw) -> list[str]:
    entry = ListDefinition("a", Position("plc/a.gvl", 1, 1), (), flaws=frozenset(flaws))
    return list(definition_flaws(Definition((entry,))))


def test_names_are_told_with_their_places() -> None:
    assert told() == []
    assert told(name("Axxis", nearest="Axis")) == [
        f"types that no file declares: Axxis (plc/a.gvl, line 1, column 5; perhaps Axis?). {END}"
    ]
    assert told(name("n", constant=True))[0].startswith("constants that no file declares: n (")
    (both,) = told(name("n", constant=True), name("T", 2))
    assert both.startswith("types and constants that no file declares: n (plc/a.gvl, line 1, column 5), T (plc/a.gvl,")


def test_of_many_the_first_are_told() -> None:
    (sentence,) = told(*(name(f"T{number}", number + 1) for number in range(1_234)))
    assert sentence.count("plc/a.gvl") == 10
    assert "T9 (plc/a.gvl, line 10" in sentence
    assert sentence.endswith(f", {count(1_224)} more. {END}")


def test_only_the_lists_that_matter_are_spoken_of() -> None:
    lists = tuple(
        ListDefinition(text, Position("a.gvl", 1, 1), (), flaws=frozenset([name(f"T_{text}")])) for text in ("a", "b")
    )
    problem = Problem("found ';'", Position("c.gvl", 0, 0), "Correct it.")
    left_out, names = definition_flaws(Definition(lists, (problem,)), lists[1:])
    assert left_out == "left out: c.gvl: found ';'. Correct it."
    assert "T_b" in names
    assert "T_a" not in names


def test_nothing_from_a_file_reaches_the_terminal_as_it_is() -> None:
    assert "\x1b" not in told(name("\x1b[2J", nearest="\x1b]0;"))[0]
    assert "\x1b" not in told(Problem("found \x1b", Position("\x1b.gvl", 1, 1), "\x1b"))[0]
    assert len(told(name("x" * 10_000))[0]) < 300
