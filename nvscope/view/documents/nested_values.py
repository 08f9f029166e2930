"""Values of the elements of a structure or an array as JSON has them: structures are objects, arrays are arrays."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

_STEP = re.compile(r"\.(?P<member>[^.\[]+)|\[(?P<places>[^\]]*)\]")


class _Members(dict[str, Any]):
    """The members of a structure, by name."""


class _Entries(dict[str, Any]):
    """The entries of an array, by index, in their order."""


_Step = tuple[type[_Members] | type[_Entries], str]
"""What something is a step in, and its name or index there."""


def nested(elements: Iterable[tuple[str, Any]]) -> Any:
    """Return the value whose elements have these names: ``.nLow``, ``[1, 2]``, ``[0].pos``; of one without, itself."""
    whole = _Entries()
    for name, value in elements:
        within: dict[str, Any] = whole
        last = ""
        for kind, step in _steps(name):
            within = within.setdefault(last, kind())
            last = step
        within[last] = value
    return _plain(whole[""])


def _steps(name: str) -> Iterator[_Step]:
    """Yield the way to an element."""
    for found in _STEP.finditer(name):
        if found["member"] is not None:
            yield _Members, found["member"]
        else:
            for place in found["places"].split(","):
                yield _Entries, place.strip()


def _plain(value: Any) -> Any:
    if isinstance(value, _Members):
        return {name: _plain(one) for name, one in value.items()}
    return [_plain(one) for one in value.values()] if isinstance(value, _Entries) else value
