"""What a finding is: a row of the catalogue of findings, for people at a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.kind import FindingKind
from nvscope.view.lines.plant.content import status
from nvscope.view.lines.table import Cell, Line, Tone, wrap


def explained(name: str, width: int) -> list[Line]:
    """Return what a kind of cause or finding means and what to do, by its name or code; nothing where it has none."""
    from nvscope.view.lines.plant.explain_cause import cause_called, cause_lines  # noqa: PLC0415  not for a finding

    cause, finding = cause_called(name), finding_called(name)
    lines = [] if cause is None else list(cause_lines(cause, width))
    if finding is not None:
        lines += [*([[]] if lines else []), *finding_lines(finding, width)]
    return lines


def finding_called(code: str) -> FindingKind | None:
    """Return the kind that a code, its number or a name stands for, None if there is none."""
    wanted = code.strip().lower()
    for kind in CATALOGUE.values():
        if wanted in {kind.code.lower(), kind.code[2:], kind.name}:
            return kind
    return None


def _where(kind: FindingKind) -> str:
    """Say where a kind is found that no report of a capture has, '' for all others."""
    if kind.of_databases:
        return "Found in databases of DataLoggers, by `nvscope audit FILE.db`: no report of a capture has it."
    return "" if kind.judged else "Nothing judges it yet: no report has this finding."


def finding_lines(kind: FindingKind, width: int) -> Iterator[Line]:
    """Yield what a kind of finding means, what usually causes it, and what to do."""
    yield [Cell(f"{kind.code} {kind.name}", Tone.STRONG), Cell("  "), status(kind.severity)]
    yield []
    if told := _where(kind):
        yield from wrap([Cell(told, Tone.NOTE)], width)
        yield []
    yield from wrap([Cell(kind.meaning)], width)
    yield []
    yield [Cell("Usual causes", Tone.STRONG)]
    for cause in kind.causes:
        yield from wrap([Cell(f"- {cause}")], width, 2, 4)
    yield []
    yield [Cell("What to do", Tone.STRONG)]
    for number, step in enumerate(kind.next_steps, 1):
        yield from wrap([Cell(f"{number}. {step}")], width, 2, 5)
