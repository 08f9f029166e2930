"""Why nothing is seen, for people: one line that answers it, what is wrong with its next step, and what is well."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from nvscope.doctor.checks import CHECKS
from nvscope.doctor.result import State
from nvscope.report.ansi import paint
from nvscope.units import count_of
from nvscope.view.escape import visible_document
from nvscope.view.lines.table import NO_BREAK, Cell, Line, Tone, wrap

MIN_WIDTH = 40
_TEXT_WIDTH = 100
_MARKS = {State.PROBLEM: "✗", State.NOTE: "!", State.UNKNOWN: "·", State.OK: "✓"}
_TONES = {State.PROBLEM: Tone.ERROR, State.NOTE: Tone.WARNING, State.UNKNOWN: Tone.NOTE, State.OK: Tone.GOOD}
_TITLES = {check.name: check.title for check in CHECKS}
_ORDER = list(State)
_INDENT = 2
_TITLE_COLUMNS = max(map(len, _TITLES.values())) + 2

Document = Mapping[str, Any]


def render(document: Document, *, everything: bool = False, colour: bool = False, width: int = 80) -> str:
    """Return a diagnosis (schema ``nvscope.doctor/1``) as text of at most ``width`` columns, ending with a line break.

    ``everything``: what is well, too, each by itself.
    """
    return paint(_lines(visible_document(document), everything, min(max(width, MIN_WIDTH), _TEXT_WIDTH)), colour=colour)


def _lines(document: Document, everything: bool, width: int) -> Iterator[Line]:
    state = State.PROBLEM if document["state"] == State.PROBLEM else State.OK
    yield from wrap(
        [Cell(f"{_MARKS[state]} ", _TONES[state]), Cell(f"{document['verdict']}.", Tone.STRONG)], width, 0, 2
    )
    results = sorted(document["results"], key=lambda one: _ORDER.index(State(one["state"])))
    shown = [one for one in results if everything or one["state"] in (State.PROBLEM, State.NOTE)]
    if shown:
        yield []
    for one in shown:
        yield from _result(one, width)
    yield from _rest(document, [] if everything else results, width)


def _result(one: Document, width: int) -> Iterator[Line]:
    state = State(one["state"])
    title = str(_TITLES.get(one["check"], one["check"]))
    hanging = _INDENT + _TITLE_COLUMNS if width >= 2 * MIN_WIDTH else 2 * _INDENT
    gap = NO_BREAK * (max(_TITLE_COLUMNS - len(title), 1) if width >= 2 * MIN_WIDTH else 2)
    told = one["seen"] if one["about"] else _capital(one["seen"])
    mark = Cell(f"{_MARKS[state]}{NO_BREAK}", _TONES[state])
    yield from wrap([mark, Cell(title, Tone.STRONG), Cell(f"{gap}{told}.")], width, 0, hanging)
    if one["next"] and state is not State.OK:
        yield from wrap([Cell("Next  ", Tone.STRONG), Cell(f"{_capital(one['next'])}.")], width, hanging, hanging + 6)


def _rest(document: Document, folded: Sequence[Document], width: int) -> Iterator[Line]:
    """Yield what is well in a line, what a file cannot tell in another, and where it was listened."""
    parts: list[list[Cell]] = []
    worst: dict[str, State] = {}
    for one in folded:  # the worst first
        worst.setdefault(one["check"], State(one["state"]))
    for state, told in ((State.OK, "{} (--all shows them)"), (State.UNKNOWN, "Unknown here: {} (--all says why)")):
        names = ", ".join(_TITLES[check.name] for check in CHECKS if worst.get(check.name) is state)
        if names:
            parts.append([Cell(f"{_MARKS[state]} ", _TONES[state]), Cell(told.format(names), Tone.FAINT)])
    if document["not_told"]:
        names = ", ".join(_TITLES.get(name, name) for name in document["not_told"])
        parts.append([Cell("· ", Tone.NOTE), Cell(f"A file cannot tell: {names}.", Tone.FAINT)])
    places = [place for place in document["places"] if not place["failure"]]
    names = ", ".join(place["name"] for place in places)
    if names:
        what = "Listened on" if document["live"] else "Read"
        parts.append([Cell("· ", Tone.NOTE), Cell(f"{what} {names}.", Tone.FAINT)])
    parts += [
        [Cell("· ", Tone.NOTE), Cell(f"{place['name']}: {place['failure']}.", Tone.FAINT)]
        for place in document["places"] if place["failure"]
    ]  # fmt: skip
    lost = [place for place in document["places"] if place["drops"]]
    parts += [
        [Cell("! ", Tone.WARNING), Cell(f"{place['name']}: {count_of(place['drops'], 'frame')} dropped meanwhile.")]
        for place in lost
    ]  # fmt: skip
    if document["left_out"]:
        told = f"{count_of(document['left_out'], 'telegram')} of further kinds were not told apart."
        parts.append([Cell("! ", Tone.WARNING), Cell(told)])
    if parts:
        yield []
    for cells in parts:
        yield from wrap(cells, width, 0, 2)


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
