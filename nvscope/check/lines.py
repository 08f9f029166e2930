"""Verdicts for people: failed rules first, with worst value, limit, margin and where it broke; passes in a line."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

from nvscope import units
from nvscope.check.deciding import Decided
from nvscope.check.run import Checked
from nvscope.check.verdict import Judged, Verdict
from nvscope.check.words import broken_first, command, counted, margin, measures, shown, subject, value_in_words, when
from nvscope.view.escape import visible
from nvscope.view.lines.plant.strips import MARKS
from nvscope.view.lines.table import Cell, Line, Tone, wrap
from nvscope.view.lines.text_width import display_width, shorten

_SYMBOLS = {
    Verdict.FAIL: Cell("✗", Tone.ERROR),
    Verdict.INCONCLUSIVE: Cell("?", Tone.WARNING),
    Verdict.PASS: Cell("●", Tone.GOOD),
}
_BROKEN = {"error": _SYMBOLS[Verdict.FAIL], "warning": Cell("!", Tone.WARNING), "note": Cell("!", Tone.NOTE)}
"""Rules that are broken, by how bad that is."""

_MOST_SUBJECTS = 5
_LONGEST_ID, _LEAST_STRIP, _LONGEST_STRIP = 28, 10, 60
_GAP = "   "


def lines(found: Checked, files: Sequence[str], paths: Sequence[str], width: int) -> Iterator[Line]:
    """Yield all that people want to know, in at most ``width`` columns; ``files`` are the rules, ``paths`` captures."""
    yield from wrap(_headline(found, files, paths), width, hanging=2)
    broken = broken_first(found)
    column = min(max((display_width(visible(one.rule.id)) for one in broken), default=0), _LONGEST_ID) + 2
    for decided in broken:
        yield []
        yield from _rule(found, decided, column, width)
    if passed := found.of(Verdict.PASS):
        yield []
        yield from wrap(_passed(passed), width, hanging=2)


def _headline(found: Checked, files: Sequence[str], paths: Sequence[str]) -> Line:
    broken = broken_first(found)
    mark = _symbol(broken[0]) if broken else _SYMBOLS[Verdict.PASS]
    summary = found.scene.snapshot.summary
    parts = [
        counted(found),
        *(visible(os.path.basename(one)) for one in files[:2]),
        *(visible(one) for one in paths[:2]),
    ]
    if summary.start_ns is not None and summary.end_ns is not None:
        parts.append(units.duration(summary.end_ns - summary.start_ns))
    return [mark, Cell(" "), Cell(parts[0], Tone.STRONG), Cell("".join(f" · {one}" for one in parts[1:]))]


def _symbol(decided: Decided) -> Cell:
    return _BROKEN[decided.rule.severity] if decided.verdict is Verdict.FAIL else _SYMBOLS[decided.verdict]


def _rule(found: Checked, decided: Decided, column: int, width: int) -> Iterator[Line]:
    name = shorten(visible(decided.rule.id), column - 2)
    symbol = _symbol(decided)
    broken = shown(decided)
    for number, judged in enumerate(broken[:_MOST_SUBJECTS]):
        if not number:
            told = [symbol, Cell(" "), Cell(f"{name:<{column}}", Tone.STRONG), *_told(found, judged)]
            yield from wrap(told, width, hanging=column + 2)
        else:
            yield from wrap(list(_told(found, judged)), width, column + 2, column + 2)
        yield from _where(found, judged, column + 2, width)
    if len(broken) > _MOST_SUBJECTS:
        yield [Cell(" " * (column + 2)), Cell(f"{len(broken) - _MOST_SUBJECTS} more: --json has all", Tone.FAINT)]
    if decided.rule.description:
        yield from wrap([Cell(visible(decided.rule.description), Tone.FAINT)], width, column + 2, column + 2)


def _told(found: Checked, judged: Judged) -> Iterator[Cell]:
    yield Cell(_GAP.join(filter(None, [subject(found, judged), *measures(judged)])))


def _where(found: Checked, judged: Judged, indent: int, width: int) -> Iterator[Line]:
    """Yield where in time it broke: a strip of the list, the first frame, and the command that shows it."""
    at = when(found, judged)
    if not at:
        return
    chronicle, key = found.scene.chronicle, str(judged.list)
    room = min(width - indent - display_width(at) - len(_GAP), _LONGEST_STRIP)
    strip = ""
    if chronicle is not None and judged.list is not None and key in chronicle.numbers and room >= _LEAST_STRIP:
        strip = "".join(MARKS[mark][0] for mark in chronicle.strips([key], room)[0]) + _GAP
    yield [Cell(" " * indent), Cell(strip), Cell(at)]
    if shows := command(found, judged):
        yield [Cell(" " * indent), Cell(shows, Tone.FAINT)]


def _passed(passed: Sequence[Decided]) -> Line:
    told = f"{units.count(len(passed))} passed"
    subjects = [(decided, one) for decided in passed for one in decided.subjects]
    measured = [(one.tightness, decided, one) for decided, one in subjects if one.tightness is not None]
    cells = [_SYMBOLS[Verdict.PASS], Cell(" "), Cell(told, Tone.STRONG)]
    if not measured:
        return cells
    _, decided, tightest = min(measured, key=lambda one: one[0])
    worst, limit = value_in_words(tightest.worst, tightest.unit), value_in_words(tightest.limit, tightest.unit)
    return [
        *cells,
        Cell(f"; the tightest is {visible(decided.rule.id)}: worst {worst}, limit {limit}, margin {margin(tightest)}"),
    ]
