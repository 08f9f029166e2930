"""Everything that an expression or -e may name: fields of telegrams, of variables, and of what is known in the end."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from nvscope.findings.kind import FindingKind
from nvscope.view.fields.field import TelegramField
from nvscope.view.fields.frame import FIELDS
from nvscope.view.fields.verdicts import Names, Verdicts, verdict_fields

if TYPE_CHECKING:  # without definitions, nothing of them is imported
    from nvscope.definition.layouts import Layouts


def vocabulary(
    layouts: Layouts | None = None,
    names: Names | None = None,
    verdicts: Verdicts | None = None,
    fields: Iterable[TelegramField] = FIELDS.values(),
    further: Iterable[FindingKind] = (),
) -> Mapping[str, TelegramField]:
    """Return all fields by name: ``fields`` of frames, and those of what is known about them.

    With ``layouts`` also ``var.*``; without ``verdicts``, judged ones cannot be read. ``further`` are kinds of findings
    that the catalogue has not.
    """
    variables: Mapping[str, TelegramField] = {}
    if layouts is not None:
        from nvscope.view.fields.variables import variable_fields  # noqa: PLC0415

        variables = variable_fields(layouts)
    own = {field.name: field for field in fields}
    return {**own, **verdict_fields(names, verdicts, further), **variables}
