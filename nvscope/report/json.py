"""The report for programs: JSON of schema ``nvscope.report/2``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any

from nvscope.view.documents.drawn import Drawn, DrawnRow, Shape
from nvscope.view.escape import json_text

if TYPE_CHECKING:  # what tables for people need takes longer to import than a small report to write
    from nvscope.view.lines.plant.content import Report

_PIECE_CHARACTERS = 1 << 20
_INDENT = 2
_DEPTH = 4  # the report, its lists, one of them, and its streams
_TOGETHER = 128
"""So many entries are written at once; those with a longer list in them bit by bit."""


def render(report: Report) -> str:
    """Return the report as indented JSON in the order given, ending with a line break.

    Plain printable ASCII, whatever the texts hold: what else there is in them is written as JSON escapes. ValueError
    for a number that JSON does not know.
    """
    return "".join(pieces(report))


def pieces(report: Report) -> Iterator[str]:
    """Yield the same in pieces of limited length, each made when it is asked for."""
    waiting: list[str] = []
    length = 0
    for part in _parts(report):
        waiting.append(part)
        length += len(part)
        if length >= _PIECE_CHARACTERS:
            yield "".join(waiting)
            waiting, length = [], 0
    yield "".join(waiting) + "\n"


def _parts(value: Any, margin: int = 0, depth: int = _DEPTH) -> Iterator[str]:
    """Yield the text of a value: lists that lie so deep in it bit by bit, all else at once."""
    inner, shape = margin + _INDENT, _shape(type(value))
    space = "\n" + " " * inner
    if shape is Mapping and depth and value and not (margin and _is_short(value)):
        opening = "{"
        for key, item in value.items():
            yield f"{opening}{space}{json_text(key)}: "
            yield from _parts(item, inner, depth - 1)
            opening = ","
        yield f"\n{' ' * margin}}}"
    elif shape is Sequence and depth and value:
        opening, entries = "[", iter(value)
        while some := list(islice(entries, _TOGETHER)):
            short = all(map(_is_short, some))
            for entry in _entries(some, inner) if short else (_parts(one, inner, depth - 1) for one in some):
                yield f"{opening}{space}"
                yield from (entry,) if isinstance(entry, str) else entry
                opening = ","
        yield f"\n{' ' * margin}]"
    else:
        yield _encoded(value, margin)


def _is_short(value: Any) -> bool:
    """Return whether nothing in a value is a long list, as far as can be seen at once."""
    if isinstance(value, DrawnRow):
        return all(len(value[key]) <= _TOGETHER for key in value.LISTS)
    if _shape(type(value)) is Mapping:
        return all(len(item) <= _TOGETHER for item in value.values() if _shape(type(item)) is Sequence)
    return True


def _number(value: float) -> str:
    if value - value != 0:
        raise ValueError(f"Out of range float values are not JSON compliant: {value!r}")
    return float.__repr__(value)


_SCALARS: Mapping[type, Callable[[Any], str]] = {
    str: json_text,
    int: int.__repr__,
    float: _number,
    bool: lambda value: "true" if value else "false",
    type(None): lambda _: "null",
}


def _encoded(value: Any, margin: int) -> str:
    """Return a value as JSON, whose lines behind the first begin with ``margin`` spaces or more."""
    encode = _SCALARS.get(type(value))
    if encode is not None:
        return encode(value)
    inner, shape = margin + _INDENT, _shape(type(value))
    if isinstance(value, DrawnRow):
        return _rows([value], margin)[0]
    if shape is Mapping:
        return _template(tuple(value), margin) % tuple(_texts(value.values(), inner))
    if isinstance(value, str | int | float):  # such as a member of an enumeration
        return _encoded(next(kind for kind in (str, int, float) if isinstance(value, kind))(value), margin)
    if shape is Sequence:
        return _list(_entries(value, inner), margin)
    raise TypeError(f"a {type(value).__name__} is nothing that JSON has")


_SHAPES: dict[type, type | None] = {str: None}


def _shape(kind: type) -> type | None:
    """Return whether values of a type are objects or arrays: to ask each of them takes longer than to write it."""
    if kind not in _SHAPES:
        shapes = () if issubclass(kind, str) else (Mapping, Sequence)
        _SHAPES[kind] = next((shape for shape in shapes if issubclass(kind, shape)), None)
    return _SHAPES[kind]


def _list(entries: Sequence[str], margin: int) -> str:
    if not entries:
        return "[]"
    space = "\n" + " " * (margin + _INDENT)
    return f"[{space}{f',{space}'.join(entries)}\n{' ' * margin}]"


def _entries(values: Iterable[Any], margin: int) -> list[str]:
    """Return the texts of the entries of a list, rows of one kind by columns."""
    found: list[str] = []
    for kind, own in groupby(values, key=type):
        alike = list(own)
        found += _rows(alike, margin) if issubclass(kind, DrawnRow) else [_encoded(one, margin) for one in alike]
    return found


def _rows(rows: Sequence[DrawnRow], margin: int) -> list[str]:
    """Return the texts of rows of one kind."""
    kind = type(rows[0])
    columns = [column for part in kind.PARTS for column in part.columns(rows)]
    texts = [_column(column, margin + _INDENT) for column in columns]
    return list(map(_row_template(kind, margin).__mod__, zip(*texts, strict=True)))


def _column(values: Sequence[Any], margin: int) -> Sequence[Any]:
    """Return the same as ``_texts``: what is alike in all at once."""
    kinds = set(map(type, values))
    if kinds == {int}:
        return values
    if kinds == {type(None)}:
        return ["null"] * len(values)
    if kinds == {Drawn}:
        entries = iter(_entries([entry for value in values for entry in value], margin + _INDENT))
        return [_list(list(islice(entries, len(value))), margin) for value in values]
    return _texts(values, margin)


def _texts(items: Iterable[Any], margin: int) -> list[Any]:
    """Return what templates write as the JSON of items: of most its text, integers as they are."""
    scalars = _SCALARS
    return [
        item if (kind := type(item)) is int
        else "null" if item is None
        else scalars[kind](item) if kind in scalars
        else _encoded(item, margin)
        for item in items
    ]  # fmt: skip


# Of a large report, nearly all objects are alike: those of the same keys are written by one template.


@lru_cache(256)
def _template(keys: tuple[str, ...], margin: int) -> str:
    return _template_of(dict.fromkeys(keys), margin)


@lru_cache(256)
def _row_template(kind: type[DrawnRow], margin: int) -> str:
    return _template_of({key: inner for part in kind.PARTS for key, inner in part.shape.items()}, margin)


def _template_of(shape: Shape, margin: int) -> str:
    if not shape:
        return "{}"
    inner = margin + _INDENT
    space = "\n" + " " * inner
    rows = [
        f"{json_text(key).replace('%', '%%')}: {'%s' if own is None else _template_of(own, inner)}"
        for key, own in shape.items()
    ]
    return f"{{{space}{f',{space}'.join(rows)}\n{' ' * margin}}}"
