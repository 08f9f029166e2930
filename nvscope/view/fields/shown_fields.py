"""The fields ``finding.*`` and ``cause.*``: what is known of the findings and causes that a telegram shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, overload

import numpy as np

from dissectors.batch import I64
from nvscope.expression.typed_columns import Column, FieldType, TextColumn
from nvscope.findings.catalogue import CATALOGUE
from nvscope.findings.finding import Finding
from nvscope.findings.kind import FindingKind, Severity
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.shown import NONE
from nvscope.view.rows.frames import FrameRows

if TYPE_CHECKING:
    from nvscope.causes.cause import Cause

FINDING, CAUSE = "finding.", "cause."
"""How the names of these fields begin."""

_SIGNED, _TEXT = FieldType.SIGNED, FieldType.TEXT
_SEVERITIES = tuple(severity.word for severity in sorted(Severity, reverse=True))


def finding_fields(findings: Sequence[Finding], further: Iterable[FindingKind] = ()) -> Iterator[TelegramField]:
    """Yield ``finding.*``; ``further`` are kinds of findings that the catalogue has not."""
    kinds = [*CATALOGUE.values(), *further]
    codes, names = ([getattr(kind, part) for kind in kinds] for part in ("code", "name"))
    counts = np.array([0, *(finding.count for finding in findings)], np.int64)

    def entry(name: str, text: str, tell: Callable[[Finding], str], texts: Iterable[str] = ()) -> TelegramField:
        read = _texts([tell(finding) for finding in findings], _finding)
        return _field(FINDING + name, _TEXT, f"Finding's {name}", text, read, _finding, tuple(dict.fromkeys(texts)))

    shown = "such as NV201; shown by the telegrams of its first ten events"
    yield entry("code", shown, lambda one: one.code, codes)
    yield entry("name", "such as telegram-gap", lambda one: one.kind.name, names)
    yield entry("severity", "error, warning or note", lambda one: one.kind.severity.word, _SEVERITIES)
    yield _field(
        FINDING + "count", _SIGNED, "Finding's count", "how many events it has",
        lambda rows: counts[_finding(rows) + 1], _finding,
    )  # fmt: skip
    yield entry("message", "its sentence", lambda one: one.message)


def cause_fields(causes: Sequence[Cause]) -> Iterator[TelegramField]:
    """Yield ``cause.*``."""

    def entry(name: str, text: str, tell: Callable[[Cause], str], texts: Sequence[str] = ()) -> TelegramField:
        read = _texts([tell(cause) for cause in causes], _cause)
        return _field(CAUSE + name, _TEXT, f"Cause's {name}", text, read, _cause, texts)

    shown = "such as second-sender; shown by the telegrams of its first ten events"
    yield entry("kind", shown, lambda one: one.kind.name, _KindNames())
    yield entry("severity", "error, warning or note", lambda one: one.severity.word, _SEVERITIES)
    yield entry("title", "its sentence", lambda one: one.title)


class _KindNames(Sequence[str]):
    """The names of all kinds of causes; they stand beside what judges them, which is imported only when one is asked
    for: most expressions ask for none."""

    @overload
    def __getitem__(self, place: int) -> str: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[str]: ...
    def __getitem__(self, place: int | slice) -> str | Sequence[str]:
        return self._names[place]

    def __len__(self) -> int:
        return len(self._names)

    @property
    def _names(self) -> tuple[str, ...]:
        from nvscope.causes.catalogue import BY_NAME  # noqa: PLC0415

        return tuple(BY_NAME)


def _field(
    name: str, kind: FieldType, label: str, text: str, read: Callable[[FrameRows], Column],
    number: Callable[[FrameRows], I64], texts: Sequence[str] = (),
) -> TelegramField:  # fmt: skip
    return TelegramField(name, kind, label, text, read, lambda rows: number(rows) != NONE, judged=True, texts=texts)


def _texts(told: Sequence[str], number: Callable[[FrameRows], I64]) -> Callable[[FrameRows], Column]:
    texts = ("", *told)
    return lambda rows: TextColumn(number(rows) + 1, texts)


def _finding(rows: FrameRows) -> I64:
    """Return the number of the finding with which each telegram is looked at, ``NONE`` where there is none."""
    return np.full(len(rows), NONE) if rows.finding is None else rows.finding


def _cause(rows: FrameRows) -> I64:
    """Return the number of the cause with which each telegram is looked at, ``NONE`` where there is none."""
    return np.full(len(rows), NONE) if rows.cause is None else rows.cause
