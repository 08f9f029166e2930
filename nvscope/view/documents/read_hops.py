"""Variables that a page showed or a database has, and a list carried, as data: how one follows the other."""

from __future__ import annotations

from typing import Any

from nvscope.definition.value import value_of
from nvscope.definition.variables import String
from nvscope.tracker.readings.form import HIDDEN
from nvscope.tracker.readings.read_hops import ListEnd, ReadEnd, ReadHops
from nvscope.tracker.readings.readings import ReadVariable
from nvscope.tracker.variables.following import UNKNOWN, Pair, Side
from nvscope.view.documents.hops import direction_of, figures
from nvscope.view.documents.read_rows import shape_of
from nvscope.view.documents.read_variables import reading_json, reading_text, reading_unit
from nvscope.view.value_texts import json_value, text_of, unit_of


def read_hop_rows(hops: ReadHops, end_ns: int | None, *, secrets: bool = False) -> list[dict[str, Any]]:
    """Return a row a variable and a stream of a list that has it, by name; otherwise as ``hop_rows``.

    The list of a page is ``visu/`` and the address of the controller, that of a database ``db/`` and its name. A
    database follows what a list carries, and ``missed`` are the changes of the list that it has not. Passwords are
    hidden without ``secrets``.
    """
    rows = []
    for read, listed, pair in hops.pairs:
        if listed.now is None or read.now is None:
            continue
        shape = shape_of(read.variable)
        hidden = read.variable.is_secret and not secrets
        ends = {False: _list_end(listed, read.variable, hidden=hidden), True: _read_end(read, hidden=hidden)}
        missed = hops.missed(pair)
        follows = direction_of(pair) if missed is None else True
        rows.append(
            {
                "variable": read.variable.name,
                "type": listed.element.type.name,
                "from": ends[not follows],
                "to": ends[follows],
                **figures(pair, read.known_until(end_ns), equal=_equal(read, listed, pair), follows=follows),
                **({"hidden": hidden} if shape.may_fail else {}),
                **({} if missed is None else {"missed": missed}),
            }
        )
    return sorted(rows, key=lambda row: (row["variable"].lower(), row["from"]["list"], row["to"]["list"]))


def _equal(read: ReadEnd, listed: ListEnd, pair: Pair[Side]) -> bool:
    """Tell whether both have the same value, or had it as long as a page told its own."""
    return pair.were_equal if read.is_over else listed.now == read.now != int(UNKNOWN)


def _list_end(end: ListEnd, read: ReadVariable, *, hidden: bool) -> dict[str, Any]:
    """Return what a list carried; a text as the other end shows it, of which it has the bytes."""
    kind = end.element.type
    value = value_of(kind, end.last)
    if isinstance(kind, String) and not kind.wide:
        value = read.as_shown(str(value))
    return {
        "list": str(end.stream.list),
        "sender": end.stream.sender,
        "telegrams": end.telegrams,
        "unit": unit_of(kind),
        "value": None if hidden else json_value(kind, value),
        "text": HIDDEN if hidden else text_of(kind, value),
    }


def _read_end(end: ReadEnd, *, hidden: bool) -> dict[str, Any]:
    assert end.last is not None
    shape = shape_of(end.variable)
    return {
        "list": end.variable.list,
        **shape.whence(end.variable),
        shape.counted: end.telegrams,
        "unit": reading_unit(end.variable, end.last),
        "value": reading_json(end.variable, end.last, hidden=hidden),
        "text": reading_text(end.variable, end.last, hidden=hidden),
    }
