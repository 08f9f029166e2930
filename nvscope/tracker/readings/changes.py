"""Changes of variables: which readings are another value than the one before."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from dissectors.batch import I64, U64, Bool
from nvscope.engine.keyed_columns import KeyedColumns
from nvscope.engine.runs import stable_order
from nvscope.tracker.readings.form import Form
from nvscope.tracker.readings.readings import Readings


class Steps(NamedTuple):
    """Readings with a value by variable, in each as they came.

    ``order`` are their rows; ``begins``: it is the first of its variable here; ``fresh``: nobody knows what was before;
    ``differs``: it is another value than before.
    """

    order: I64
    begins: Bool
    fresh: Bool
    differs: Bool


class _LastColumns(KeyedColumns):
    """One row a variable: its last value, NOTHING where nobody knows it."""

    form: I64
    bits: U64
    COLUMNS: ClassVar = {"form": (np.int64(Form.NOTHING), 1), "bits": (np.uint64(0), 1)}


class ChangeMemory:
    """What variables were last, by number, as far as somebody has listened since."""

    def __init__(self) -> None:
        self._last = _LastColumns()

    def forget(self) -> None:
        """Begin anew: nobody listened for a while."""
        self._last = _LastColumns()

    def steps(self, readings: Readings, wanted: Bool | None = None) -> Steps:
        """Take readings, those that are ``wanted``, which follow those before; those without a value are passed over.

        A change is another value, not another text: 1.0 and 1.00 of a REAL are equal.
        """
        has_value = readings.form > Form.NOTHING
        rows = np.flatnonzero(has_value if wanted is None else has_value & wanted)
        variable = readings.variable[rows]
        bound = int(variable.max(initial=-1)) + 1
        order = rows[stable_order(variable, bound)] if len(rows) else rows
        variable, form, bits = readings.variable[order], readings.form[order], readings.bits[order]
        last = self._last
        last.resize(bound)
        begins = np.ones(len(order), np.bool_)
        begins[1:] = variable[1:] != variable[:-1]
        form_before, bits_before = np.empty_like(form), np.empty_like(bits)
        form_before[1:], bits_before[1:] = form[:-1], bits[:-1]
        form_before[begins], bits_before[begins] = last.form[variable[begins]], last.bits[variable[begins]]
        fresh = form_before == Form.NOTHING
        differs = ~fresh & ((form != form_before) | (bits != bits_before))
        ends = np.append(begins[1:], True) if len(begins) else begins
        last.form[variable[ends]], last.bits[variable[ends]] = form[ends], bits[ends]
        return Steps(order, begins, fresh, differs)


class UnknownMemory:
    """Which variables are unknown, by number: no more what they were, and nobody knows what they are."""

    def __init__(self) -> None:
        self._unknown: set[int] = set()

    def turns(self, readings: Readings) -> Bool:
        """Take readings, which follow those before; return where a variable becomes unknown, or is known again."""
        found = np.zeros(len(readings), np.bool_)
        unknown = readings.form == Form.UNKNOWN
        if not self._unknown and not unknown.any():
            return found
        rows = np.flatnonzero(readings.form != Form.NOTHING)
        order = rows[np.argsort(readings.variable[rows], kind="stable")]
        variable, now = readings.variable[order], unknown[order]
        begins = np.append(True, variable[1:] != variable[:-1])[: len(order)]
        before = np.append(False, now[:-1])[: len(order)]
        before[begins] = [number in self._unknown for number in variable[begins].tolist()]
        found[order] = now != before
        ends = np.append(begins[1:], True)[: len(order)]
        for number, is_unknown in zip(variable[ends].tolist(), now[ends].tolist(), strict=True):
            (self._unknown.add if is_unknown else self._unknown.discard)(number)
        return found
