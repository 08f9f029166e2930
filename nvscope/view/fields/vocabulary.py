"""Everything that an expression or -e may name: fields of telegrams, of variables, and of what is known in the end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from nvscope.expression.words import Words, words_of
from nvscope.findings.kind import FindingKind
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import FIELDS
from nvscope.view.fields.verdicts import Names, Verdicts, verdict_fields

if TYPE_CHECKING:  # without definitions, nothing of them is imported
    from nvscope.definition.layouts import Layouts
    from nvscope.view.fields.variables import VariableFields


class Vocabulary(Words[TelegramField]):
    """All fields by name: those of frames and of what is known about them, and behind them those of variables."""

    def __init__(self, fields: Mapping[str, TelegramField], variables: VariableFields | None = None) -> None:
        self._fields = words_of(fields)
        self._variables = variables

    def spelled(self, text: str) -> str | None:
        found = self._fields.spelled(text)
        return self._variables.spelled(text) if found is None and self._variables is not None else found

    def __getitem__(self, name: str) -> TelegramField:
        if self._variables is None or name in self._fields:
            return self._fields[name]
        return self._variables[name]

    def __iter__(self) -> Iterator[str]:
        yield from self._fields
        if self._variables is not None:
            yield from self._variables

    @property
    def unlisted(self) -> int:
        """How many elements of lists have fields that are not iterated, though they can be asked for."""
        return 0 if self._variables is None else self._variables.unlisted


def vocabulary(
    layouts: Layouts | None = None,
    names: Names | None = None,
    verdicts: Verdicts | None = None,
    fields: Iterable[TelegramField] = FIELDS.values(),
    further: Iterable[FindingKind] = (),
) -> Vocabulary:
    """Return all fields by name: ``fields`` of frames, and those of what is known about them.

    With ``layouts`` also ``var.*``; without ``verdicts``, judged ones cannot be read. ``further`` are kinds of findings
    that the catalogue has not.
    """
    variables = None
    if layouts is not None:
        from nvscope.view.fields.variables import VariableFields  # noqa: PLC0415

        variables = VariableFields(layouts)
    own = {field.name: field for field in fields}
    return Vocabulary({**own, **verdict_fields(names, verdicts, further)}, variables)
