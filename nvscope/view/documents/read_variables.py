"""Variables of which readings are as rows of the documents that have variables of lists: ``nvscope.vars/1`` and others.

Rows are as those of lists; what else they say of a variable, and how readings are counted, is the ``RowShape`` of
whoever says the values. Where a value is none of its type, its text is all that is known.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from msgspec import Struct

from nvscope.definition.value import Value
from nvscope.definition.variables import Scalar, ScalarKind
from nvscope.tracker.readings.form import HIDDEN, Form, cut_text
from nvscope.tracker.readings.last_values import LastValues, ValueColumns
from nvscope.tracker.readings.readings import ReadValues, ReadVariable
from nvscope.tracker.readings.value_history import ReadEntry, Reading, ValueHistory
from nvscope.tracker.readings.values_at import ValuesAt
from nvscope.view.value_texts import exact_text, json_value, text_of, unit_of

UNKNOWN = "unknown"
"""The type of a variable of which nobody says one."""


NOT_IN_REPLIES = "not in replies"
"""Why there never was a value that a controller was asked for: its replies had fewer of them."""


class RowShape(Struct, frozen=True):
    """What rows of the variables of one protocol have of their own.

    ``whence`` is told of a variable behind its type, ``further`` behind its values; ``counted`` is what readings are
    called. With ``may_fail``, values may be hidden or unreadable; ``never`` is why there never was one.
    """

    counted: str
    whence: Callable[[Any], dict[str, Any]]
    further: Callable[[Any], dict[str, Any]]
    may_fail: bool
    never: str


def value_rows(values: LastValues, shape: RowShape, *, secrets: bool = False) -> list[dict[str, Any]]:
    """Return a row a variable, in their order: its last value, when and how often it changed, and its bounds.

    Of what was never readable there is no value. What is, or may be, a password is hidden without ``secrets``.
    """
    rows = []
    columns = values.columns
    for number, variable in _meant(values.read):
        hidden = variable.is_secret and not secrets
        readings = int(columns.readings[number])
        last = last_reading(columns, values.texts, number, variable)
        # What is another variable now may have been a password before, at the same place.
        was_secret = bool(columns.secret_frame[number]) and not secrets
        least, most = (None, None) if hidden or was_secret else bounds_of(columns, number)
        rows.append(
            {
                **_called(variable, shape),
                "unit": reading_unit(variable, last),
                "value": None if last is None else reading_json(variable, last, hidden=hidden),
                "text": None if last is None else reading_text(variable, last, hidden=hidden),
                "last_ns": str(int(columns.last_ns[number])) if readings else None,
                "changed_ns": str(int(columns.changed_ns[number])) if readings else None,
                shape.counted: readings,
                "changes": int(columns.changes[number]),
                "min": None if least is None else reading_json(variable, least, hidden=False),
                "max": None if most is None else reading_json(variable, most, hidden=False),
                "min_text": None if least is None else reading_text(variable, least, hidden=False),
                "max_text": None if most is None else reading_text(variable, most, hidden=False),
                **shape.further(variable),
                **(
                    {"unreadable": int(columns.unreadable[number]), "hidden": hidden and bool(readings)}
                    if shape.may_fail
                    else {}
                ),
            }
        )  # fmt: skip
    return rows


def rows_at(values: ValuesAt, time_ns: int, shape: RowShape, *, secrets: bool = False) -> list[dict[str, Any]]:
    """Return a row a variable: its last value up to a moment and how old that is, or why there is none."""
    rows = []
    for number, variable in _meant(values.read):
        last = values.at(number, time_ns)
        hidden = last is not None and (last.reading.is_secret or variable.is_secret) and not secrets
        rows.append(
            {
                **_called(variable, shape),
                "unit": None if last is None else reading_unit(variable, last.reading),
                "value": None if last is None else reading_json(variable, last.reading, hidden=hidden),
                "text": None if last is None else reading_text(variable, last.reading, hidden=hidden),
                "frame": None if last is None else last.frame,
                "sent_ns": None if last is None else str(last.time_ns),
                "age_ns": None if last is None else time_ns - last.time_ns,
                "missing": None if last else _missing(values, number, shape),
                **shape.further(variable),
                **({"hidden": hidden} if shape.may_fail else {}),
            }
        )
    return rows


def change_row(entry: ReadEntry, shape: RowShape, *, secrets: bool = False) -> dict[str, Any]:
    """Return one value of one variable; ``old`` is None where nobody knows what it was before."""
    variable, old, new = entry.variable, entry.before, entry.now
    hides_old = old is not None and old.is_secret and not secrets
    hides_new = new.is_secret and not secrets
    return {
        "frame": entry.frame,
        "time_ns": str(entry.time_ns),
        "list": variable.list,
        **shape.whence(variable),
        "name": entry.name,
        "changed": entry.changed,
        "unit": reading_unit(variable, new),
        "old": None if old is None else reading_json(variable, old, hidden=hides_old),
        "new": reading_json(variable, new, hidden=hides_new),
        "old_text": None if old is None else _exact(variable, old, hidden=hides_old),
        "new_text": _exact(variable, new, hidden=hides_new),
        **shape.further(variable),
        **({"hidden": hides_new} if shape.may_fail else {}),
    }


def change_rows(history: ValueHistory, shape: RowShape) -> list[dict[str, Any]]:
    """Return how often and how fast each variable changed, in their order."""
    tracks = history.tracks
    return [
        {
            **_called(variable, shape),
            shape.counted: int(tracks.readings[number]),
            "first_ns": str(int(tracks.first_ns[number])),
            "last_ns": str(int(tracks.last_ns[number])),
            "changes": int(tracks.changes[number]),
            "changed_ns": str(int(tracks.changed_ns[number])) if tracks.changes[number] else None,
            "shortest_ns": history.shortest_ns(number),
            "longest_ns": None if tracks.longest_ns[number] < 0 else int(tracks.longest_ns[number]),
            **shape.further(variable),
        }
        for number, variable in _meant(history.read)
        if number < len(tracks) and tracks.readings[number]
    ]


def _missing(values: ValuesAt, number: int, shape: RowShape) -> str:
    """Return why a variable has no value at a moment."""
    if number in values.readable:
        return "later"
    return NOT_IN_REPLIES if shape.may_fail and number not in values.unreadable else shape.never


def _meant(read: ReadValues) -> list[tuple[int, ReadVariable]]:
    known = read.known
    return sorted(((number, known[number]) for number in read.meant), key=lambda one: one[1].order)


def _called(variable: ReadVariable, shape: RowShape) -> dict[str, Any]:
    return {
        "list": variable.list,
        "name": variable.name,
        "type": variable.type or UNKNOWN,
        **shape.whence(variable),
    }


def reading_unit(variable: ReadVariable, last: Reading | None) -> str | None:
    """Return in which unit ``reading_json`` is, None of what has none."""
    form, bits = (Form.NOTHING, 0) if last is None else (last.form, last.bits)
    kind = variable.kind_of(form, bits)
    return None if kind is None else unit_of(kind)


def value_of_bits(variable: ReadVariable, form: int, bits: int) -> Value | None:
    """Return the number of which these are the bits, as the type has it; None of what is none."""
    if form == Form.REAL:
        number: float = struct.unpack("<d", struct.pack("<Q", bits))[0]
        return number
    if form != Form.WHOLE:
        return None
    whole: int = struct.unpack("<q", struct.pack("<Q", bits))[0]
    kind = variable.kind_of(form, bits)
    is_bool = isinstance(kind, Scalar) and kind.kind is ScalarKind.BOOL
    return bool(whole) if is_bool else whole


def _value(variable: ReadVariable, reading: Reading) -> Value | None:
    return reading.text if reading.form is Form.TEXT else value_of_bits(variable, reading.form, reading.bits)


def reading_json(variable: ReadVariable, reading: Reading, *, hidden: bool) -> Any:
    """Return a value as JSON has it, None of what is hidden or none of its type."""
    value = None if hidden else _value(variable, reading)
    kind = variable.kind_of(reading.form, reading.bits)
    return None if value is None or kind is None else json_value(kind, value)


def reading_text(variable: ReadVariable, reading: Reading, *, hidden: bool) -> str:
    """Return a value as an engineer writes it; its text where it is none of its type."""
    if hidden:
        return HIDDEN
    value = _value(variable, reading)
    kind = variable.kind_of(reading.form, reading.bits)
    return reading.text if value is None or kind is None else text_of(kind, value)


def _exact(variable: ReadVariable, reading: Reading, *, hidden: bool) -> str:
    if hidden:
        return HIDDEN
    value = _value(variable, reading)
    kind = variable.kind_of(reading.form, reading.bits)
    return cut_text(reading.text) if value is None or kind is None else exact_text(kind, value)


def last_reading(
    columns: ValueColumns, texts: Mapping[int, str], number: int, variable: ReadVariable
) -> Reading | None:  # fmt: skip
    """Return the last value of a variable, by its number; None where it never had one."""
    if not columns.readings[number]:
        return None
    form = Form(int(columns.form[number]))
    return Reading(form, int(columns.bits[number]), texts[number], variable.is_secret)


def bounds_of(columns: ValueColumns, number: int) -> Sequence[Reading | None]:
    """Return the least and the greatest number of a variable, None where there was none."""
    sides: list[list[tuple[int | float, Reading]]] = [[], []]
    for form, least, most in (
        (Form.WHOLE, columns.least, columns.most), (Form.REAL, columns.least_real, columns.most_real)
    ):  # fmt: skip
        if least[number] <= most[number]:
            for told, side in zip(sides, (least, most), strict=True):
                bits = int(side[number : number + 1].view(np.uint64)[0])
                told.append((side[number].item(), Reading(form, bits, "", False)))
    if not sides[0]:
        return None, None
    return min(sides[0], key=itemgetter(0))[1], max(sides[1], key=itemgetter(0))[1]
