"""Variables that several lists have, as data: how one follows the other, and for how long they differed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nvscope.definition.value import value_of
from nvscope.tracker.variables.following import Direction, Pair
from nvscope.tracker.variables.hops import End, Hops, ordered
from nvscope.units import divide
from nvscope.view.value_texts import json_value, unit_of, value_text


def hop_rows(hops: Hops, end_ns: int | None) -> list[dict[str, Any]]:
    """Return a row a pair of lists with the same variable, by name.

    ``from`` is the end whose changes the other one follows: more of them, or sooner. ``changes`` are those of ``to``,
    ``followed`` of them to a value that ``from`` had taken before; ``delay_ns`` is how long that took (percentiles
    within 1 %). ``differed_ns`` of ``observed_ns`` both were not equal, up to ``end_ns``, the end of the capture.
    """
    return [_row(pair, end_ns) for _, pair in ordered(hops.pairs)]


def _row(pair: Pair[End], end_ns: int | None) -> dict[str, Any]:
    leader, follower = (pair.first, pair.second) if direction_of(pair) else (pair.second, pair.first)
    return {
        "variable": leader.element.name,
        "type": leader.element.type.name,
        "from": _end(leader),
        "to": _end(follower),
        **figures(pair, end_ns, equal=pair.first.last == pair.second.last),
    }


def direction_of(pair: Pair[Any]) -> bool:
    """Tell whether the second end follows the first, or else the first the second."""
    return _rank(pair.forth) >= _rank(pair.back)


def figures(pair: Pair[Any], end_ns: int | None, *, equal: bool, follows: bool | None = None) -> dict[str, Any]:
    """Return how the end that follows does, and for how long both differed; ``equal``: they are in the end.

    ``follows``: the second follows the first; None: as it looks.
    """
    direction = pair.forth if (direction_of(pair) if follows is None else follows) else pair.back
    since_ns = pair.until_ns if pair.first.is_known and pair.second.is_known else None
    rest_ns = 0 if end_ns is None or since_ns is None else max(end_ns - since_ns, 0)
    return {
        "changes": direction.changes,
        "followed": direction.followed,
        "delay_ns": _delays(direction),
        "observed_ns": pair.observed_ns + rest_ns,
        "differed_ns": pair.differed_ns + (0 if equal else rest_ns),
        "equal": equal,
    }


def _rank(direction: Direction) -> tuple[float, int]:
    """Return what tells which end follows the other: how many of its changes do, and how soon."""
    share = direction.followed / direction.changes if direction.changes else 0.0
    return round(share, 2), -(direction.percentile_ns(50) or 0)


def _end(end: End) -> dict[str, Any]:
    kind = end.element.type
    return {
        "list": str(end.stream.list),
        "sender": end.stream.sender,
        "telegrams": end.telegrams,
        "unit": unit_of(kind),
        "value": json_value(kind, value_of(kind, end.last)),
        "text": value_text(kind, end.last),
    }


def _delays(direction: Direction) -> Mapping[str, int | None]:
    if not direction.timed:
        return dict.fromkeys(("count", "min", "mean", "p50", "p99", "max")) | {"count": 0}
    return {
        "count": direction.timed,
        "min": direction.least_ns,
        "mean": divide(direction.total_ns, direction.timed),
        "p50": direction.percentile_ns(50),
        "p99": direction.percentile_ns(99),
        "max": direction.most_ns,
    }
