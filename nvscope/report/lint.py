"""Mistakes in definition files for people: one paragraph each, and behind the first of a rule why it matters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from nvscope.report.ansi import paint
from nvscope.units import count_of
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import Cell, Line, Tone, wrap

MIN_WIDTH = 40

_TONES = {"error": Tone.ERROR, "warning": Tone.WARNING, "note": Tone.NOTE}

Document = Mapping[str, Any]


def render(document: Document, *, colour: bool = False, width: int = 80) -> str:
    """Return mistakes (schema ``nvscope.lint/1``) as text of at most ``width`` columns, ending with a line break."""
    return paint(_lines(visible_document(document), max(width, MIN_WIDTH)), colour=colour)


def render_rules(document: Document, *, colour: bool = False, width: int = 80) -> str:
    """Return the rules of a document as text of at most ``width`` columns, ending with a line break."""
    return paint(_rule_lines(visible_document(document)["rules"], max(width, MIN_WIDTH)), colour=colour)


def _lines(document: Document, width: int) -> Iterator[Line]:
    untold = {rule["id"]: rule for rule in document["rules"]}
    for mistake in document["mistakes"]:
        place = f"{mistake['file']}:{mistake['line']}:{mistake['column']}: "
        head = [
            Cell(place, Tone.STRONG),
            Cell(mistake["severity"], _TONES[mistake["severity"]]),
            Cell(f": {mistake['message']} "),
            Cell(f"[{mistake['rule']}]", Tone.FAINT),
        ]
        yield from wrap(head, width, 0, 4)
        rule = untold.pop(mistake["rule"], None)
        if rule is not None:
            yield from wrap([Cell(f"{rule['why']} {rule['next_step']}", Tone.FAINT)], width, 4)
    if document["mistakes"]:
        yield []
    yield from wrap(_summary(document), width)


def _summary(document: Document) -> list[Cell]:
    severities = [mistake["severity"] for mistake in document["mistakes"]]
    looked = f"{count_of(document['lists'], 'list')} in {count_of(len(document['files']), 'file')}"
    if not document["lists"]:
        return [Cell(f"No list in {count_of(len(document['files']), 'file')}: only types are declared.", Tone.WARNING)]
    if not severities:
        return [Cell("Nothing to complain about", Tone.GOOD), Cell(f": {looked}.")]
    cells = [Cell("Found ")]
    for severity in ("error", "warning", "note"):
        number = severities.count(severity)
        if number:
            cells += [Cell(", ")] * (len(cells) > 1) + [Cell(count_of(number, severity), _TONES[severity])]
    return [*cells, Cell(f" in {looked}.")]


def _rule_lines(rules: list[Document], width: int) -> Iterator[Line]:
    for number, rule in enumerate(rules):
        if number:
            yield []
        head = [
            Cell(rule["id"], Tone.STRONG),
            Cell(" ("),
            Cell(rule["severity"], _TONES[rule["severity"]]),
            Cell(f"): {rule['summary']}"),
        ]
        yield from wrap(head, width, 0, 4)
        yield from wrap([Cell(f"{rule['why']} {rule['next_step']}")], width, 4)
