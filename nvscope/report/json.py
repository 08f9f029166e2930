"""The report for programs: JSON of schema ``nvscope.report/2``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from nvscope.view.escape import json_text

if TYPE_CHECKING:  # what tables for people need takes longer to import than a small report to write
    from nvscope.report.content import Report

_PIECE_CHARACTERS = 1 << 20
_INDENT = 2
_DEPTH = 4  # the report, its lists, one of them, and its streams
_LONG = 256


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
    """Yield the text of a value: the entries of long lists that lie so deep in it one by one, all else at once."""
    inner = " " * (margin + _INDENT)
    shape = _shape(type(value))
    if shape is Mapping and depth and value:
        items = list(value.values())
        if margin and not any(len(item) > _LONG for item in items if _shape(type(item)) is Sequence):
            yield _object(value, items, margin)
            return
        opening = "{"
        for key, item in zip(value, items, strict=True):
            yield f"{opening}\n{inner}{json_text(key)}: "
            yield from _parts(item, margin + _INDENT, depth - 1)
            opening = ","
        yield f"\n{' ' * margin}}}"
    elif shape is Sequence and depth and value:
        opening = "["
        for item in value:
            yield f"{opening}\n{inner}"
            yield from _parts(item, margin + _INDENT, depth - 1)
            opening = ","
        yield f"\n{' ' * margin}]"
    else:
        yield _encoded(value, margin)


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
    if shape is Mapping:
        return _object(value, value.values(), margin)
    if isinstance(value, str | int | float):  # such as a member of an enumeration
        return _encoded(next(kind for kind in (str, int, float) if isinstance(value, kind))(value), margin)
    if shape is Sequence:
        if not value:
            return "[]"
        space = "\n" + " " * inner
        return f"[{space}{f',{space}'.join([_encoded(item, inner) for item in value])}\n{' ' * margin}]"
    raise TypeError(f"a {type(value).__name__} is nothing that JSON has")


_SHAPES: dict[type, type | None] = {str: None}


def _shape(kind: type) -> type | None:
    """Return whether values of a type are objects or arrays: to ask each of them takes longer than to write it."""
    if kind not in _SHAPES:
        shapes = () if issubclass(kind, str) else (Mapping, Sequence)
        _SHAPES[kind] = next((shape for shape in shapes if issubclass(kind, shape)), None)
    return _SHAPES[kind]


def _object(keys: Iterable[str], items: Iterable[Any], margin: int) -> str:
    """Return an object of some keys, of which each has its item.

    Those of the same keys are written by one template: of a large report, nearly all are alike. It writes integers as
    they are.
    """
    inner, scalars = margin + _INDENT, _SCALARS
    return _template(tuple(keys), margin) % tuple([
        item if (kind := type(item)) is int
        else scalars[kind](item) if kind in scalars
        else _encoded(item, inner)
        for item in items
    ])  # fmt: skip


@lru_cache(256)
def _template(keys: tuple[str, ...], margin: int) -> str:
    if not keys:
        return "{}"
    space = "\n" + " " * (margin + _INDENT)
    rows = [f"{json_text(key).replace('%', '%%')}: %s" for key in keys]
    return f"{{{space}{f',{space}'.join(rows)}\n{' ' * margin}}}"
