"""What a check is: a row of the catalogue, for people at a terminal and for programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any

from nvscope.check.catalogue import CATALOGUE
from nvscope.check.check import Check
from nvscope.check.parameters import PERCENTS, REQUIRED, Parameter
from nvscope.duration import format_duration
from nvscope.toml_table import LENGTH, SPAN
from nvscope.view.lines.table import Cell, Line, Tone, wrap


def check_called(name: str) -> Check | None:
    """Return the check of a name, in any case, with underscores or hyphens; None where there is none."""
    return CATALOGUE.get(name.strip().lower().replace("-", "_"))


def near(name: str) -> list[str]:
    """Return checks whose names are nearly so."""
    return get_close_matches(name.strip().lower(), CATALOGUE, n=3)


def check_lines(check: Check, width: int) -> Iterator[Line]:
    """Yield what a check is for, what is measured, when it fails, its parameters, and an example."""
    yield [Cell(check.name, Tone.STRONG), Cell("  "), Cell(f"check of a rule, for each {check.subject}", Tone.NOTE)]
    yield []
    yield from wrap([Cell(check.help)], width)
    yield []
    yield from wrap([Cell(f"Measured: {check.worst}. It fails when {check.fails}.")], width)
    notes = []
    if check.needs_definitions:
        # Those of databases and pages are called what they are where they come from.
        of_lists = "Of variables of lists, it" if check.subject == "variable" else "It"
        notes.append(f"{of_lists} cannot be decided without definitions.")
    if check.by_moment or check.at_times:
        notes.append("With when = EXPRESSION it is judged only while that holds.")
    if notes:
        yield from wrap([Cell(" ".join(notes))], width)
    if check.parameters:
        yield []
        names = max(len(one.name) for one in check.parameters) + 2
        for one in check.parameters:
            told = f"{one.help} ({one.kind.name}, {default_of(one)})"
            yield from wrap([Cell(one.name.ljust(names), Tone.STRONG), Cell(told)], width, hanging=names)
    yield []
    for line in ("[[rule]]", 'id = "my-rule"', *check.example.splitlines()):
        yield [Cell(f"  {line}", Tone.FAINT)]


def check_data(check: Check) -> Mapping[str, Any]:
    """Return the same as data."""
    return {
        "name": check.name,
        "subject": check.subject,
        "help": check.help,
        "worst": check.worst,
        "fails": check.fails,
        "parameters": [
            {"name": one.name, "kind": one.kind.name, "help": one.help, "default": default_of(one)}
            for one in check.parameters
        ],
        "example": check.example,
    }


def default_of(parameter: Parameter) -> str:
    """Return what a parameter is where it is left out, in words."""
    default = parameter.default
    if default is REQUIRED:
        return "required"
    if default in (None, ()):
        return "may be left out"
    if isinstance(default, bool):
        return f"default {str(default).lower()}"
    if parameter.kind in PERCENTS:
        return f"default {100 * default:g}%"
    if parameter.kind in (LENGTH, SPAN):
        return f"default {format_duration(default)}"
    return f"default {default}"
