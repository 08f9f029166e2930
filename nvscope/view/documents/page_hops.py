"""Variables that a page showed and a list carried, as data: how one follows the other, how long they differed."""

from __future__ import annotations

from typing import Any

from nvscope.definition.value import value_of
from nvscope.definition.visu_values import value_in
from nvscope.tracker.readings.form import HIDDEN
from nvscope.tracker.visu.page_hops import ListEnd, PageEnd, PageHops
from nvscope.view.documents.hops import direction_of, figures
from nvscope.view.value_texts import json_value, text_of, unit_of, value_text


def page_hop_rows(hops: PageHops, end_ns: int | None, *, secrets: bool = False) -> list[dict[str, Any]]:
    """Return a row a variable of a page and a stream of a list that has it, by name; otherwise as ``hop_rows``.

    The list of a page is ``visu/`` and the address of the controller. Passwords are hidden without ``secrets``.
    """
    rows = []
    for page, listed, pair in hops.pairs:
        if not len(pair.first.values) or not len(page.values):
            continue
        hidden = page.variable.is_secret and not secrets
        ends = {False: _list_end(listed, hidden=hidden), True: _page_end(page, hidden=hidden)}
        follows = direction_of(pair)
        rows.append(
            {
                "variable": page.variable.name,
                "type": listed.element.type.name,
                "from": ends[not follows],
                "to": ends[follows],
                **figures(pair, end_ns, equal=bool(pair.first.values[-1] == page.values[-1])),
                "hidden": hidden,
            }
        )
    return sorted(rows, key=lambda row: (row["variable"].lower(), row["from"]["list"], row["to"]["list"]))


def _list_end(end: ListEnd, *, hidden: bool) -> dict[str, Any]:
    kind = end.element.type
    return {
        "list": str(end.stream.list),
        "sender": end.stream.sender,
        "telegrams": end.telegrams,
        "unit": unit_of(kind),
        "value": None if hidden else json_value(kind, value_of(kind, end.last)),
        "text": HIDDEN if hidden else value_text(kind, end.last),
    }


def _page_end(end: PageEnd, *, hidden: bool) -> dict[str, Any]:
    kind = end.variable.kind
    value = value_in(kind, end.text)
    is_shown = kind is not None and value is not None and not hidden
    return {
        "list": end.variable.list,
        "sender": end.variable.sender,
        "telegrams": end.telegrams,
        "unit": None if kind is None else unit_of(kind),
        "value": json_value(kind, value) if is_shown and kind is not None and value is not None else None,
        "text": HIDDEN if hidden else text_of(kind, value) if kind is not None and value is not None else end.text,
    }
