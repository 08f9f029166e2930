"""Variables of WebVisu pages as rows of the documents that have variables of lists: ``nvscope.vars/1`` and others.

Rows are as those of lists: ``list`` is ``visu/`` and the address of the controller, which is the ``sender``;
``telegrams`` are the replies that have a value, and confirmed writes. Where a value is none of the type that the
request says, its text is all that is known.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from typing import Any

from nvscope.definition.value import Value
from nvscope.definition.variables import Scalar, ScalarKind, String, type_text
from nvscope.tracker.visu.last_values import LastValues, cut_text
from nvscope.tracker.visu.number_texts import Form
from nvscope.tracker.visu.readings import ReadValues
from nvscope.tracker.visu.value_history import PageEntry, Reading, ValueHistory
from nvscope.tracker.visu.values_at import ValuesAt
from nvscope.tracker.visu.variables import PageVariable
from nvscope.tracker.visu.writes import HIDDEN
from nvscope.view.value_texts import exact_text, json_value, text_of, unit_of

_DIGITS = re.compile(r"([0-9]{1,18})")

UNKNOWN = "unknown"
"""The type of a variable of which nobody says one."""


def page_rows(values: LastValues, *, secrets: bool = False) -> list[dict[str, Any]]:
    """Return a row a variable: its last value, when and how often it changed, and its bounds; by controller and name.

    Of what was never readable there is no value. What is, or may be, a password is hidden without ``secrets``.
    """
    rows = []
    columns = values.columns
    for number, variable in _meant(values.read):
        hidden = variable.is_secret and not secrets
        readings = int(columns.readings[number])
        last = None
        if readings:
            form = Form(int(columns.form[number]))
            last = Reading(form, int(columns.bits[number]), values.texts[number], variable.is_secret)
        least, most = (None, None) if hidden else _bounds(values, number, variable)
        rows.append(
            {
                **_called(variable),
                "unit": None if variable.kind is None else unit_of(variable.kind),
                "value": None if last is None else _json(variable, last, hidden=hidden),
                "text": None if last is None else _text(variable, last, hidden=hidden),
                "last_ns": str(int(columns.last_ns[number])) if readings else None,
                "changed_ns": str(int(columns.changed_ns[number])) if readings else None,
                "telegrams": readings,
                "changes": int(columns.changes[number]),
                "min": None if least is None else _json_of(variable, least),
                "max": None if most is None else _json_of(variable, most),
                "min_text": None if least is None else _text_of(variable, least),
                "max_text": None if most is None else _text_of(variable, most),
                "place": variable.place,
                "unreadable": int(columns.unreadable[number]),
                "hidden": hidden and bool(readings),
            }
        )  # fmt: skip
    return rows


def page_rows_at(values: ValuesAt, time_ns: int, *, secrets: bool = False) -> list[dict[str, Any]]:
    """Return a row a variable: its last value up to a moment and how old that is, or why there is none."""
    rows = []
    for number, variable in _meant(values.read):
        last = values.then.get(number)
        hidden = last is not None and (last.reading.is_secret or variable.is_secret) and not secrets
        rows.append(
            {
                **_called(variable),
                "unit": None if variable.kind is None or last is None else unit_of(variable.kind),
                "value": None if last is None else _json(variable, last.reading, hidden=hidden),
                "text": None if last is None else _text(variable, last.reading, hidden=hidden),
                "frame": None if last is None else last.frame,
                "sent_ns": None if last is None else str(last.time_ns),
                "age_ns": None if last is None else time_ns - last.time_ns,
                "missing": None if last else "later" if number in values.readable else "not readable",
                "place": variable.place,
                "hidden": hidden,
            }
        )
    return rows


def page_change_row(entry: PageEntry, *, secrets: bool = False) -> dict[str, Any]:
    """Return one value of one variable; ``old`` is None where nobody knows what it was before."""
    variable, old, new = entry.variable, entry.before, entry.now
    hides_old = old is not None and old.is_secret and not secrets
    hides_new = new.is_secret and not secrets
    return {
        "frame": entry.frame,
        "time_ns": str(entry.time_ns),
        "list": variable.list,
        "sender": variable.sender,
        "name": entry.name,
        "changed": entry.changed,
        "unit": None if variable.kind is None else unit_of(variable.kind),
        "old": None if old is None else _json(variable, old, hidden=hides_old),
        "new": _json(variable, new, hidden=hides_new),
        "old_text": None if old is None else _exact(variable, old, hidden=hides_old),
        "new_text": _exact(variable, new, hidden=hides_new),
        "place": variable.place,
        "hidden": hides_new,
    }


def page_change_summary(history: ValueHistory) -> list[dict[str, Any]]:
    """Return how often and how fast each variable changed, by controller and name."""
    tracks = history.tracks
    return [
        {
            **_called(variable),
            "telegrams": int(tracks.readings[number]),
            "first_ns": str(int(tracks.first_ns[number])),
            "last_ns": str(int(tracks.last_ns[number])),
            "changes": int(tracks.changes[number]),
            "changed_ns": str(int(tracks.changed_ns[number])) if tracks.changes[number] else None,
            "shortest_ns": history.shortest_ns(number),
            "longest_ns": None if tracks.longest_ns[number] < 0 else int(tracks.longest_ns[number]),
            "place": variable.place,
        }
        for number, variable in _meant(history.read)
        if number < len(tracks) and tracks.readings[number]
    ]


def order_of(variable: PageVariable) -> tuple[Any, ...]:
    """Return what variables are sorted by: controller, those with a name first, its numbers as numbers, and place."""
    parts = [int(part) if part.isdigit() else part for part in _DIGITS.split(variable.name.lower())]
    return variable.controller.order, variable.name == variable.place, parts, variable.place


def _meant(read: ReadValues) -> list[tuple[int, PageVariable]]:
    known = read.variables.known
    return sorted(((number, known[number]) for number in read.meant), key=lambda one: order_of(one[1]))


def _called(variable: PageVariable) -> dict[str, Any]:
    return {
        "list": variable.list,
        "name": variable.name,
        "type": type_told(variable),
        "sender": variable.sender,
    }


def type_told(variable: PageVariable) -> str:
    """Return what the type of a variable is called: as the request calls it, of a STRING with its length."""
    kind = variable.kind
    return type_text(kind) if isinstance(kind, String) else variable.type or UNKNOWN


def value_of_bits(variable: PageVariable, form: int, bits: int) -> Value | None:
    """Return the number of which these are the bits, as the type has it; None of what is none."""
    if form == Form.REAL:
        number: float = struct.unpack("<d", struct.pack("<Q", bits))[0]
        return number
    if form != Form.WHOLE:
        return None
    whole: int = struct.unpack("<q", struct.pack("<Q", bits))[0]
    is_bool = isinstance(variable.kind, Scalar) and variable.kind.kind is ScalarKind.BOOL
    return bool(whole) if is_bool else whole


def _value(variable: PageVariable, reading: Reading) -> Value | None:
    return reading.text if reading.form is Form.TEXT else value_of_bits(variable, reading.form, reading.bits)


def _json(variable: PageVariable, reading: Reading, *, hidden: bool) -> Any:
    value = None if hidden else _value(variable, reading)
    return None if value is None else _json_of(variable, value)


def _json_of(variable: PageVariable, value: Value) -> Any:
    assert variable.kind is not None
    return json_value(variable.kind, value)


def _text_of(variable: PageVariable, value: Value) -> str:
    assert variable.kind is not None
    return text_of(variable.kind, value)


def _text(variable: PageVariable, reading: Reading, *, hidden: bool) -> str:
    if hidden:
        return HIDDEN
    value = _value(variable, reading)
    return reading.text if value is None else _text_of(variable, value)


def _exact(variable: PageVariable, reading: Reading, *, hidden: bool) -> str:
    value = None if hidden else _value(variable, reading)
    if hidden:
        return HIDDEN
    if value is None or variable.kind is None:
        return cut_text(reading.text)
    return exact_text(variable.kind, value)


def _bounds(values: LastValues, number: int, variable: PageVariable) -> Sequence[Value | None]:
    columns = values.columns
    if columns.least[number] <= columns.most[number]:
        sides: Sequence[Value] = int(columns.least[number]), int(columns.most[number])
        is_bool = isinstance(variable.kind, Scalar) and variable.kind.kind is ScalarKind.BOOL
        return [bool(side) for side in sides] if is_bool else sides
    if columns.least_real[number] <= columns.most_real[number]:
        return float(columns.least_real[number]), float(columns.most_real[number])
    return None, None
