"""What is said about names that no file declares."""

from __future__ import annotations

from nvscope.definition.model import UnknownName
from nvscope.definition.position import Position
from nvscope.units import count
from nvscope.view.lines.unknown_names import unknown_names

END = "Name the files that do, too: a .TcDUT, a PLCopen XML export, ST text, or a list of constants."


def name(text: str, line: int = 1, **others: object) -> UnknownName:
    return UnknownName(text, Position("plc/a.gvl", line, 5), **others)  # type: ignore[arg-type]


def test_names_are_told_with_their_places() -> None:
    assert unknown_names([]) == ""
    assert unknown_names([name("Axxis", nearest="Axis")]) == (
        f"types that no file declares: Axxis (plc/a.gvl, line 1, column 5; perhaps Axis?). {END}"
    )
    assert unknown_names([name("n", constant=True)]).startswith("constants that no file declares: n (")
    both = unknown_names([name("n", constant=True), name("T", 2)])
    assert both.startswith("types and constants that no file declares: n (plc/a.gvl, line 1, column 5), T (plc/a.gvl,")


def test_of_many_the_first_are_told() -> None:
    told = unknown_names([name(f"T{number}") for number in range(1_234)])
    assert told.count("plc/a.gvl") == 10
    assert told.endswith(f", {count(1_224)} more. {END}")


def test_nothing_from_a_file_reaches_the_terminal_as_it_is() -> None:
    assert "\x1b" not in unknown_names([name("\x1b[2J", nearest="\x1b]0;")])
    assert len(unknown_names([name("x" * 10_000)])) < 300
