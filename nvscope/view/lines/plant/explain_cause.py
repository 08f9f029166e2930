"""What a cause is: a row of the catalogue of causes, for people at a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.causes.catalogue import KINDS
from nvscope.causes.kind import CauseKind
from nvscope.findings.kind import Severity
from nvscope.view.lines.table import NO_BREAK, Cell, Column, Line, Tone, align, wrap

_ABOUT_WIDTH = 12


def cause_called(name: str) -> CauseKind | None:
    """Return the kind of cause of a name in any case, or None."""
    wanted = name.strip().lower()
    return next((kind for kind in KINDS if kind.name == wanted), None)


def cause_lines(kind: CauseKind, width: int) -> Iterator[Line]:
    """Yield what happened where reports tell this cause, by what it is told, and what to do."""
    yield from wrap([Cell(kind.name, Tone.STRONG), Cell("  "), Cell("cause", Tone.NOTE)], width)
    yield []
    yield from wrap([Cell(kind.meaning)], width)
    for title, text in ("Told by", kind.evidence), ("What to do", kind.next_step):
        yield []
        yield [Cell(title, Tone.STRONG)]
        yield from wrap([Cell(text)], width, 2)
    yield []
    about = [
        ("severity", _severity(kind)),
        ("list's row", kind.brief),
        ("filter", f"-Y{NO_BREAK}'cause.kind{NO_BREAK}=={NO_BREAK}\"{kind.name}\"'"),
    ]
    for what, text in about:
        yield from wrap([Cell(what.ljust(_ABOUT_WIDTH)), Cell(text)], width, hanging=_ABOUT_WIDTH)


def _severity(kind: CauseKind) -> str:
    if kind.at_least == max(Severity):
        return f"{kind.at_least.word}, whatever it explains"
    if kind.at_least == min(Severity):
        return f"that of the worst finding that it explains, a {kind.at_least.word} where it explains none"
    return f"that of the worst finding that it explains, at least {kind.at_least.word}"


def causes_table(width: int) -> list[Line]:
    """Return a table of all kinds of causes, in the order in which they are judged."""
    rows = [[Cell(kind.name, Tone.STRONG), Cell(kind.brief)] for kind in KINDS]
    return align([Column("cause", shortest=8), Column("in the row of its list", shortest=8)], rows, width)
