"""What differs between two captures, for people and as data (schema ``nvscope.captures-diff/1``)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from msgspec.structs import replace

from nvscope.analysis.comparison import Difference
from nvscope.list_key import ListKey
from nvscope.report.ansi import paint
from nvscope.units import count_of, list_key
from nvscope.version import head
from nvscope.view.escape import visible
from nvscope.view.lines.table import Cell, Line, Tone, wrap

SCHEMA = "nvscope.captures-diff/1"


def document(
    found: Sequence[Difference], captures: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:  # fmt: skip
    """Return both captures, as reports have them, and what differs, in its order."""
    return {
        **head(SCHEMA),
        "a": captures[0],
        "b": captures[1],
        "differences": [
            {
                "kind": one.kind,
                "list": None if one.where.list is None else str(one.where.list),
                "node": one.where.node,
                "subindex": one.where.subindex,
                "what": one.what,
                "a": one.a or None,
                "b": one.b or None,
                "why": one.why,
            }
            for one in found
        ],
    }


def render(
    found: Sequence[Difference], paths: Sequence[str], names: Mapping[ListKey, str], *, colour: bool, width: int
) -> str:  # fmt: skip
    """Return what differs, by list: what it was in the first capture, and what it is in the other one."""
    return paint(_lines(found, paths, names, width), colour=colour)


def _lines(
    found: Sequence[Difference], paths: Sequence[str], names: Mapping[ListKey, str], width: int
) -> Iterator[Line]:
    told = count_of(len(found), "difference") if found else "no difference"
    mark = Cell("≠", Tone.WARNING) if found else Cell("●", Tone.GOOD)
    files = f" · {visible(paths[0])} → {visible(paths[1])}"
    yield from wrap([mark, Cell(" "), Cell(told, Tone.STRONG), Cell(files)], width, hanging=2)
    for key, group in groupby(found, key=lambda one: one.where.list):
        yield []
        if key is None:
            yield [Cell("the plant", Tone.STRONG)]
        else:
            name = names.get(key) or names.get(key.on_any_channel)
            short = list_key(str(key)).rpartition("/")[2]
            yield [Cell(f"list {short}{f' {visible(name)}' if name else ''}", Tone.STRONG)]
        folded: dict[Difference, list[int]] = {}
        for one in group:
            of_all = replace(one, where=replace(one.where, subindex=None))
            folded.setdefault(of_all, []).extend([] if one.where.subindex is None else [one.where.subindex])
        for one, subindexes in folded.items():
            yield from wrap(list(_told(one, subindexes)), width, 2, 4)


def _told(one: Difference, subindexes: Sequence[int]) -> Iterator[Cell]:
    node = one.where.node
    where = [visible(node)] if node and one.kind != "cause" else []
    where += [f"SubIndex {', '.join(map(str, subindexes))}"] if subindexes else []
    what = one.what.replace("_", " ") if one.kind == "figure" else one.what
    place = f" ({', '.join(where)})" if where else ""
    if one.a and one.b:
        yield Cell(f"{what}{place}: {visible(one.a)} → {visible(one.b)}")
    else:
        yield Cell(_of_one_alone(one, what, place), Tone.WARNING)
    if note := one.why or (one.what if one.kind == "cause" else ""):
        yield Cell(f"   {note}", Tone.FAINT)


def _of_one_alone(one: Difference, what: str, place: str) -> str:
    """Return what is said of something that only one of the captures has."""
    if one.kind == "list":
        return "no more there" if one.a else "new"
    if one.kind == "node":
        return f"{visible(one.where.node or '')} {'sends no more' if one.a else 'sends, and did not before'}"
    if one.kind == "cause":
        return f"{'no more' if one.a else 'new'}: {visible(one.a or one.b)}"
    value = one.a or one.b
    told = "" if value == "there" else f": {visible(value)}"
    return f"{'no more' if one.a else 'new'}: {what}{place}{told}"
