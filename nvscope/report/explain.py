"""What causes and findings mean, and what a figure or a column tells: the tables of these, for people at a terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from nvscope.errors import UsageError
from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.kind import FindingKind
from nvscope.report.ansi import paint
from nvscope.report.explain_column import MEANINGS, column_called, column_lines
from nvscope.report.explain_figure import figure_called, figure_lines
from nvscope.tracker.figures import FIGURES, Figure
from nvscope.version import head
from nvscope.view.lines.plant.content import status
from nvscope.view.lines.plant.explain_finding import finding_called, finding_lines
from nvscope.view.lines.table import Cell, Column, Line, Tone, align

if TYPE_CHECKING:  # who asks for a code need not wait for what causes are judged from
    from nvscope.causes.kind import CauseKind

SCHEMA = "nvscope.explain/1"

_MIN_WIDTH = 40
_TEXT_WIDTH = 90
_CODE = re.compile(r"(nv)?[0-9]+", re.IGNORECASE)


class _Named(Struct, frozen=True):
    """All that has a name."""

    causes: Sequence[CauseKind] = ()
    findings: Sequence[FindingKind] = ()
    figures: Sequence[Figure] = ()
    columns: Sequence[str] = ()

    def __bool__(self) -> bool:
        return any((self.causes, self.findings, self.figures, self.columns))


def render(
    name: str, *, colour: bool = False, width: int = 80, further: Iterable[Iterable[Line]] = (),
    near: Sequence[str] = (),
) -> str:  # fmt: skip
    """Return what a kind of cause or finding means and what to do, or what a figure or a column tells.

    ``name`` may be a code, its number alone, or a name, in any case: ``second-sender``, ``NV301``, ``301``,
    ``no-acknowledgement``, ``lost``, ``list.lost``, ``status``. Of a name that several have, all are told, the cause
    first; ``further`` is what others tell of it, ``near`` what of theirs is called nearly so. UsageError, with the
    nearest known ones, for anything else.
    """
    width = told_width(width)
    lines: list[Line] = []
    others = list(further)
    found = _called(name) if others else _found(name, near)
    for told in (*_told(found, width), *others):
        lines += [[], *told] if lines else told
    return paint(lines, colour=colour)


def told_width(width: int) -> int:
    """Return how wide texts are on a terminal of a width."""
    return min(max(width, _MIN_WIDTH), _TEXT_WIDTH)


def _told(found: _Named, width: int) -> Iterator[Iterable[Line]]:
    if found.causes:
        from nvscope.view.lines.plant.explain_cause import cause_lines  # noqa: PLC0415

        yield from (cause_lines(cause, width) for cause in found.causes)
    yield from (finding_lines(kind, width) for kind in found.findings)
    yield from (figure_lines(figure, width) for figure in found.figures)
    yield from (column_lines(title, width) for title in found.columns)


def document(
    name: str | None, checks: Sequence[Mapping[str, Any]] = (), near: Sequence[str] = ()
) -> dict[str, Any]:  # fmt: skip
    """Return what ``render`` tells as data (schema ``nvscope.explain/1``); without a name of all there is.

    ``checks`` are those of rules. UsageError as ``render``.
    """
    if name is None:
        from nvscope.causes.catalogue import KINDS  # noqa: PLC0415

        found = _Named(KINDS, list(CATALOGUE.values()), FIGURES, list(MEANINGS))
    else:
        found = _called(name) if checks else _found(name, near)
    return {
        **head(SCHEMA),
        "causes": [
            {
                "kind": kind.name,
                "brief": kind.brief,
                "at_least": kind.at_least.word,
                "meaning": kind.meaning,
                "evidence": kind.evidence,
                "next": kind.next_step,
            }
            for kind in found.causes
        ],
        "findings": [
            {
                "code": kind.code,
                "name": kind.name,
                "severity": kind.severity.word,
                "judged": bool(kind.judged),
                "audited": bool(kind.of_databases),
                "security": bool(kind.of_security),
                "meaning": kind.meaning,
                "causes": list(kind.causes),
                "next_steps": list(kind.next_steps),
            }
            for kind in found.findings
        ],
        "figures": [
            {
                "name": figure.name,
                "unit": figure.unit or None,
                "help": figure.help,
                "of": [of.value for of in figure.of],
                "joins": figure.joins.value,
            }
            for figure in found.figures
        ],
        "columns": [{"title": title, "meaning": MEANINGS[title]} for title in found.columns],
        "checks": list(checks),
    }


def is_code(name: str) -> bool:
    """Tell whether a name is the code of a finding, or its number: nothing else is called so."""
    return _CODE.fullmatch(name.strip()) is not None


def _called(name: str) -> _Named:
    """Return all that has a name."""
    kind, figure, column = finding_called(name), figure_called(name.strip().lower()), column_called(name)
    return _Named(
        () if is_code(name) else _causes_called(name), [kind] if kind else [],
        [figure] if figure else [], [column] if column else [],
    )  # fmt: skip


def _found(name: str, near: Sequence[str]) -> _Named:
    """Return all that has a name; UsageError where nothing has."""
    found = _called(name)
    if not found:
        told = name.strip()
        what = "the name of what to explain is empty"
        if told:
            what = f"no cause, finding, figure, column or check is called {name}"
        raise UsageError(what, next_step=_nearest(told.lower(), near))
    return found


def _causes_called(name: str) -> Sequence[CauseKind]:
    from nvscope.view.lines.plant.explain_cause import cause_called  # noqa: PLC0415

    cause = cause_called(name)
    return [cause] if cause else []


def overview(*, colour: bool = False, width: int = 80) -> str:
    """Return tables of all kinds of causes, of all kinds of findings, and of those that no report has so far."""
    return paint(_overview(max(width, _MIN_WIDTH)), colour=colour)


def _overview(width: int) -> Iterator[Line]:
    from nvscope.view.lines.plant.explain_cause import causes_table  # noqa: PLC0415

    kinds = CATALOGUE.values()
    yield [Cell("Causes: what happened", Tone.STRONG)]
    yield from causes_table(width)
    yield []
    yield [Cell("Findings: what a rule saw", Tone.STRONG)]
    yield from _table([kind for kind in kinds if kind.judged and not kind.of_security], width)
    yield []
    yield [Cell("Security: who should not be there, or passes for somebody else", Tone.STRONG)]
    yield from _table([kind for kind in kinds if kind.judged and kind.of_security], width)
    yield []
    yield [Cell("DataLogger databases: what an audit saw", Tone.STRONG)]
    yield from _table([kind for kind in kinds if kind.of_databases], width)
    unjudged = [kind for kind in kinds if not kind.judged and not kind.of_databases]
    if unjudged:
        yield []
        yield [Cell("Nothing judges these yet", Tone.STRONG)]
        yield from _table(unjudged, width)


def _table(kinds: Sequence[FindingKind], width: int) -> list[Line]:
    rows = [[status(kind.severity), Cell(kind.code, Tone.STRONG), Cell(kind.name)] for kind in kinds]
    return align([Column("severity"), Column("code"), Column("name", shortest=8)], rows, width)


def _begins_word(name: str, wanted: str) -> bool:
    return len(wanted) > 2 and f"-{wanted}" in f"-{name}"


def _nearest(wanted: str, near_checks: Sequence[str]) -> str:
    from difflib import get_close_matches  # noqa: PLC0415

    from nvscope.causes.catalogue import KINDS  # noqa: PLC0415

    causes = {word: kind for kind in KINDS for word in (kind.name, kind.brief)}
    called = {causes[word].name for word in get_close_matches(wanted, causes, n=3)}
    told = [kind.name for kind in KINDS if kind.name in called or _begins_word(kind.name, wanted)]
    words = {word: kind for kind in CATALOGUE.values() for word in (kind.code.lower(), kind.code[2:], kind.name)}
    near = {words[word].code for word in get_close_matches(wanted, words, n=5)}
    close = [kind for kind in CATALOGUE.values() if kind.code in near or _begins_word(kind.name, wanted)]
    told += [f"{kind.code} {kind.name}" for kind in close]
    figures = {figure.name.lower(): figure.name for figure in FIGURES}
    for kind in close:
        figures.pop(kind.name, None)
    told += [figures[word] for word in get_close_matches(wanted.rpartition(".")[2], figures, n=3)]
    columns = {title.lower(): title for title in MEANINGS}
    told += [title for word in get_close_matches(wanted, columns, n=3) if (title := columns[word]) not in told]
    told += [name for name in near_checks if name not in told]
    if not told:
        return "`nvscope explain` without a code lists all causes and findings, `nvscope keys --fields` all figures"
    return f"perhaps {', '.join(told)}"
